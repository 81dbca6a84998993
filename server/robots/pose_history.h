// The poses of one session as they were published, for `path` and for poses at past stamps. Append-only in increasing
// stamps; readers get a PathView that never changes. Blocks of 256 poses and their list are shared, so a view costs the
// same for a long path as for a short one. Bounded: beyond `max_poses` the older half keeps every second pose.
// Thread rule: PoseHistory belongs to the session's lock; a PathView may be read anywhere.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "common/sensor/trajectory.h"
#include "common/service/pose_report.h"

namespace cairn::server {

// A pose with what its report said of it.
struct PathPose {
  Stamp stamp = 0;
  Pose2 T_map_robot;
  float score = 0.0F;
  bool localized = false;
  PoseReason reason = PoseReason::kWaiting;
  Eigen::Matrix3f covariance = Eigen::Matrix3f::Zero();  // Covariance of (x, y, theta) in the map frame.
  Pose2 T_map_odom;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.stamp, self.T_map_robot, self.score, self.localized, self.reason, self.covariance, self.T_map_odom);
    archive.Require(self.reason <= PoseReason::kNotJoined, "the reason of a pose");
  }
};

class PathView {
 public:
  using Block = std::shared_ptr<const std::vector<PathPose>>;

  using Blocks = std::shared_ptr<const std::vector<Block>>;

  PathView() = default;
  // Neither is null; no block is empty; `tail` continues the blocks and may be empty. Stamps increase through all.
  PathView(Blocks full, Block tail) : full_(std::move(full)), tail_(std::move(tail)) {}

  [[nodiscard]] bool empty() const { return tail_->empty() && full_->empty(); }
  [[nodiscard]] std::size_t size() const;
  // REQUIRES of both: not empty().
  [[nodiscard]] Stamp first_stamp() const { return (full_->empty() ? tail_ : full_->front())->front().stamp; }
  [[nodiscard]] Stamp last_stamp() const { return (tail_->empty() ? full_->back() : tail_)->back().stamp; }
  // Interpolated between the two poses around `stamp`, covariance too, with the worse one's score and reason; nothing
  // outside first_stamp()..last_stamp().
  [[nodiscard]] std::optional<PathPose> At(Stamp stamp) const;
  // To read the path piece by piece, in order. No block is empty.
  [[nodiscard]] std::size_t blocks() const { return full_->size() + (tail_->empty() ? 0 : 1); }
  [[nodiscard]] const std::vector<PathPose>& block(std::size_t i) const {
    return i < full_->size() ? *(*full_)[i] : *tail_;
  }

 private:
  Blocks full_ = std::make_shared<const std::vector<Block>>();
  Block tail_ = std::make_shared<const std::vector<PathPose>>();
};

class PoseHistory {
 public:
  explicit PoseHistory(std::size_t max_poses) : max_poses_(max_poses) {}

  // A stamp not after the last one is left out: a path has increasing stamps.
  void Append(const PathPose& pose);
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

  void ThinOlderHalf();
  [[nodiscard]] bool Grows() const;  // Every stamp is later than the one before it.

  const std::size_t max_poses_;
  std::size_t size_ = 0;
  PathView::Blocks full_ = std::make_shared<const std::vector<PathView::Block>>();
  std::vector<PathPose> tail_;  // Fewer than kBlockPoses.
};

}  // namespace cairn::server
