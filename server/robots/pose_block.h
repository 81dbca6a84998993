// Pieces of a session's path, and how they move when the map around them does. A moved block keeps the poses before and
// the moves to make, and makes them when it is read, on whatever thread: hours of poses do not delay the robot whose
// map was corrected.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/mutex.h"
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

// A correction of the map, as the poses of a path follow it. Plain values.
struct PathMove {
  // The map around the robot at this stamp has moved by this. `T_new_old` is the identity where it stays.
  struct Knot {
    Stamp stamp = 0;
    Pose2 T_new_old;
  };
  std::vector<Knot> knots;  // By increasing stamps.
  // Whether poses after the last knot move with it. Otherwise they stay.
  bool moves_rest = true;
  // Set where the path is no longer, or is from now on, one in a frame of its own: such poses are not localized.
  std::optional<bool> fragment;

  // Moves poses with increasing stamps. Each goes with the map at the knot before it and with that at the knot after
  // it, and comes to lie between the two results as it lies between their stamps.
  void Apply(std::vector<PathPose>& poses) const;
  // Whether it changes any pose that there may be between these stamps.
  [[nodiscard]] bool Changes(Stamp first, Stamp last) const;

 private:
  using At = std::vector<Knot>::const_iterator;
  [[nodiscard]] At After(Stamp stamp) const;  // The first knot after it.
  void Move(PathPose& pose, At after) const;
};

// Poses with increasing stamps, which no longer change. Thread rule: any thread.
class PoseBlock {
 public:
  PoseBlock() = default;
  explicit PoseBlock(std::vector<PathPose> poses)
      : PoseBlock(std::make_shared<const std::vector<PathPose>>(std::move(poses)), {}) {}

  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] std::size_t size() const { return size_; }
  // REQUIRES of both: not empty().
  [[nodiscard]] Stamp first_stamp() const { return first_stamp_; }
  [[nodiscard]] Stamp last_stamp() const { return last_stamp_; }
  // The index of the first pose at or after `stamp`; size() if there is none.
  [[nodiscard]] std::size_t IndexFrom(Stamp stamp) const;
  // One pose, without moving the others. REQUIRES: index < size().
  [[nodiscard]] PathPose pose(std::size_t index) const;
  // All poses. The first call after moves makes these, which takes less than a microsecond for each pose.
  [[nodiscard]] const std::vector<PathPose>& poses() const;

  // The same poses moved once more; `block` itself where the move changes none of them.
  [[nodiscard]] static std::shared_ptr<const PoseBlock> Moved(const std::shared_ptr<const PoseBlock>& block,
                                                              const std::shared_ptr<const PathMove>& move);

  // For checkpoints: the bytes are those of the poses.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    if constexpr (Archive::kReads) {
      std::vector<PathPose> poses;
      archive(poses);
      self.NoteExtent(poses);
      const MutexLock lock(self.mutex_);
      self.poses_ = std::make_shared<const std::vector<PathPose>>(std::move(poses));
    } else {
      archive(self.poses());
    }
  }

 private:
  using Poses = std::shared_ptr<const std::vector<PathPose>>;
  using Moves = std::vector<std::shared_ptr<const PathMove>>;
  static constexpr std::size_t kMostMoves = 16;  // A block that is never read makes its moves after so many.

  PoseBlock(Poses poses, Moves moves) : poses_(std::move(poses)), moves_(std::move(moves)) { NoteExtent(*poses_); }
  void NoteExtent(const std::vector<PathPose>& poses) {
    size_ = poses.size();
    if (poses.empty()) return;
    first_stamp_ = poses.front().stamp;
    last_stamp_ = poses.back().stamp;
  }

  // No move changes these.
  std::size_t size_ = 0;
  Stamp first_stamp_ = 0, last_stamp_ = 0;
  mutable Mutex mutex_;
  mutable Poses poses_ CAIRN_GUARDED_BY(mutex_) = std::make_shared<const std::vector<PathPose>>();
  mutable Moves moves_ CAIRN_GUARDED_BY(mutex_);  // Not made yet.
};

}  // namespace cairn::server
