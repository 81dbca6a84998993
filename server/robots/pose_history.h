// The live path of one session, for `path` and for poses at past stamps: a pose per scan that was used. They lie where
// the map has them now: when the map around them is corrected, they move with it (MoveOnto), so that what is answered
// later agrees with the tiles of today and not with what was once published. Append-only in increasing stamps; readers
// get a PathView that never changes. Blocks of 256 poses and their list are shared, so a view costs the same for a long
// path as for a short one, and a correction costs some microseconds for each block (pose_block.h). Bounded: beyond
// `max_poses` the older half keeps every second pose.
// Thread rule: PoseHistory belongs to the session's lock; a PathView may be read anywhere.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/sensor/trajectory.h"
#include "server/robots/pose_block.h"

namespace cairn::server {

class PathView {
 public:
  using Block = std::shared_ptr<const PoseBlock>;
  using Blocks = std::shared_ptr<const std::vector<Block>>;

  PathView() = default;
  // Neither is null; no block is empty; `tail` continues the blocks and may be empty. Stamps increase through all.
  PathView(Blocks full, Block tail) : full_(std::move(full)), tail_(std::move(tail)) {}

  [[nodiscard]] bool empty() const { return tail_->empty() && full_->empty(); }
  [[nodiscard]] std::size_t size() const;
  // REQUIRES of both: not empty().
  [[nodiscard]] Stamp first_stamp() const { return (full_->empty() ? tail_ : full_->front())->first_stamp(); }
  [[nodiscard]] Stamp last_stamp() const { return (tail_->empty() ? full_->back() : tail_)->last_stamp(); }
  // Interpolated between the two poses around `stamp`, covariance too, with the worse one's score and reason; nothing
  // outside first_stamp()..last_stamp().
  [[nodiscard]] std::optional<PathPose> At(Stamp stamp) const;
  // To read the path piece by piece, in order. No block is empty.
  [[nodiscard]] std::size_t blocks() const { return full_->size() + (tail_->empty() ? 0 : 1); }
  [[nodiscard]] const std::vector<PathPose>& block(std::size_t i) const {
    return (i < full_->size() ? (*full_)[i] : tail_)->poses();
  }

 private:
  Blocks full_ = std::make_shared<const std::vector<Block>>();
  Block tail_ = std::make_shared<const PoseBlock>();
};

class PoseHistory {
 public:
  explicit PoseHistory(std::size_t max_poses) : max_poses_(max_poses) {}

  // A stamp not after the last one is left out: a path has increasing stamps.
  void Append(const PathPose& pose);
  // The map around the path was corrected: at these stamps (increasing) the robot is at these poses of it now. Between
  // two of them the path goes on from both (PathMove); where they lie within a millimetre of it, it stays.
  // `moves_rest`: what comes after the last of them moves with that one; otherwise it stays. `fragment`:
  // PathMove::fragment. Takes less than a microsecond for each of `now` and each block.
  void MoveOnto(std::span<const StampedPose> now, bool moves_rest, std::optional<bool> fragment);
  // Forgets all poses. Views that were taken stay as they are.
  void Clear();
  [[nodiscard]] PathView view() const;
  [[nodiscard]] std::size_t size() const { return size_; }

  // For checkpoints (slam/state/archive.h), which share the full blocks.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    if constexpr (Archive::kReads) {
      std::vector<PathView::Block> full;
      archive(full, self.tail_);
      self.size_ = self.tail_.size();
      for (const PathView::Block& block : full) {
        if (!archive.Require(block != nullptr && !block->empty(), "a block of a path")) return;
        self.size_ += block->size();
      }
      self.full_ = std::make_shared<const std::vector<PathView::Block>>(std::move(full));
      archive.Require(self.Grows(), "the stamps of a path");
    } else {
      archive(*self.full_, self.tail_);
    }
  }

 private:
  static constexpr std::size_t kBlockPoses = 256;

  static constexpr std::size_t kMovedPerAppend = 4;  // Blocks: less than a millisecond.

  void ThinOlderHalf();
  [[nodiscard]] std::vector<PathMove::Knot> KnotsOf(std::span<const StampedPose> now) const;
  [[nodiscard]] bool Grows() const;  // Every stamp is later than the one before it.

  const std::size_t max_poses_;
  std::size_t size_ = 0;
  PathView::Blocks full_ = std::make_shared<const std::vector<PathView::Block>>();
  std::vector<PathPose> tail_;  // Fewer than kBlockPoses.
  std::size_t moved_ = 0;       // So many of the full blocks have made their moves, or were read since.
};

}  // namespace cairn::server
