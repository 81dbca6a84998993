// Writes the checkpoint of a session in parts, over several commits, so that a large one does not delay other commits.
// Part 0 (the head) is written last and completes the checkpoint; older checkpoints are removed in the same commit. The
// record number is position * 65,536 + part. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/store/store.h"

namespace cairn::server {

class CheckpointWriter {
 public:
  static constexpr std::size_t kPartBytes = std::size_t{1} << 20;
  static constexpr std::size_t kPartsPerCommit = 4;

  CheckpointWriter(std::uint64_t session, std::uint64_t position, std::string bytes)
      : session_(session), position_(position), bytes_(std::move(bytes)) {}

  // Adds the next parts to a commit that is about to be made.
  void AddTo(RecordChanges& changes);
  // Whether all parts, including the head, have been added to commits.
  [[nodiscard]] bool complete() const { return complete_; }
  [[nodiscard]] std::uint64_t session() const { return session_; }
  [[nodiscard]] std::uint64_t position() const { return position_; }

 private:
  [[nodiscard]] RecordKey KeyOf(std::uint32_t part) const;

  const std::uint64_t session_;
  const std::uint64_t position_;
  const std::string bytes_;
  std::uint32_t parts_ = 0;
  std::size_t written_ = 0;
  bool complete_ = false;
};

// The newest complete checkpoint of a session.
struct StoredCheckpoint {
  std::uint64_t position = 0;
  std::string bytes;
};
// DATA_LOSS: it is damaged, or a part of it is missing.
[[nodiscard]] Result<std::optional<StoredCheckpoint>> ReadCheckpoint(Store& store, std::uint64_t session);

}  // namespace cairn::server
