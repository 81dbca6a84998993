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

#include "common/sensor/trajectory.h"
#include "common/service/request.h"
#include "server/robots/pose_history.h"

namespace cairn::server {

inline constexpr std::size_t kPartBudgetBytes = 48 * 1024;

// The poses of a path, one after the other; the path is shared until they are sent.
class PathItems {
 public:
  PathItems() = default;
  explicit PathItems(PathView online) : online_(std::move(online)) {}
  explicit PathItems(std::shared_ptr<const Trajectory> smoothed) : smoothed_(std::move(smoothed)) {}

  [[nodiscard]] bool empty() const;
  // REQUIRES: not empty().
  [[nodiscard]] StampedPose Take();

 private:
  PathView online_;
  std::shared_ptr<const Trajectory> smoothed_;  // If there is one, `online_` is empty.
  std::size_t block_ = 0, next_ = 0;            // The next pose of `online_`, or `next_` of `smoothed_`.
};

// An answer. Its tiles and its path are shared with the map and the session until they are sent; those of the reply
// stay empty.
struct Answer {
  Answer(Reply all, std::vector<std::shared_ptr<const Tile>> of_map = {})  // NOLINT(google-explicit-constructor)
      : reply(std::move(all)), tiles(std::move(of_map)) {}
  Answer(Reply all, PathItems of_robot) : reply(std::move(all)), path(std::move(of_robot)) {}

  Reply reply;
  std::vector<std::shared_ptr<const Tile>> tiles;
  PathItems path;
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
  PathItems path_;
  Reply header_;  // Without items.
  Reply items_;   // Only the lists of it are used.
  struct {
    std::size_t poses = 0, tiles = 0, landmarks = 0, maps = 0, robots = 0, jobs = 0, saved = 0;
    std::size_t ros2_namespaces = 0, edits = 0;
  } taken_;  // Items in the parts so far.
  bool done_ = false;
};

}  // namespace cairn::server
