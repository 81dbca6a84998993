// Cuts an answer into parts that fit the wire (less than 64 KB each, idl/README.md), one after the other, so that a
// large answer never stands in memory whole. Every part repeats the header and the status. Items keep their order.
// Parts are numbered from 0, and the last one has `last` set. An answer without items is one part.
// Not thread-safe: one owner.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/service/request.h"

namespace cairn::server {

inline constexpr std::size_t kPartBudgetBytes = 48 * 1024;

// An answer. Its tiles are shared with the map until they are sent; `reply.tiles` stays empty.
struct Answer {
  Answer(Reply all, std::vector<std::shared_ptr<const Tile>> of_map = {})  // NOLINT(google-explicit-constructor)
      : reply(std::move(all)), tiles(std::move(of_map)) {}

  Reply reply;
  std::vector<std::shared_ptr<const Tile>> tiles;
};

class ReplyParts {
 public:
  explicit ReplyParts(Answer&& answer);

  // Nothing after the last part.
  [[nodiscard]] std::optional<Reply> Next();

 private:
  class Part;
  [[nodiscard]] bool Fill(Reply& part);

  std::vector<std::shared_ptr<const Tile>> tiles_;
  Reply header_;  // Without items.
  Reply items_;   // Only the lists of it are used.
  struct {
    std::size_t poses = 0, path = 0, tiles = 0, landmarks = 0, maps = 0, robots = 0, jobs = 0, saved = 0;
    std::size_t ros2_namespaces = 0;
  } taken_;  // Items in the parts so far.
  bool done_ = false;
};

}  // namespace cairn::server
