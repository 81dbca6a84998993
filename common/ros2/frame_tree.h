// The newest transform of each frame to its parent, as the topics tf and tf_static tell it. A bounded number of frames.
// Not a buffer over time: what is looked up is how a lidar is mounted, which does not change while a robot drives, or
// changes slowly. Not thread-safe: one owner.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/ros2/messages.h"
#include "common/status.h"

namespace cairn::ros2 {

// The motion that a pose says. Fails for numbers that are not finite and for a quaternion that is not of length 1.
[[nodiscard]] Result<Eigen::Isometry3d> MotionOf(const Pose3& pose);
// Its part in the plane: where it is and which way its x axis points.
[[nodiscard]] Pose2 PlanarPart(const Eigen::Isometry3d& motion);

class FrameTree {
 public:
  static constexpr std::size_t kMaxFrames = 1024;

  struct Link {
    std::string parent;
    Eigen::Isometry3d T_parent_child;
  };

  // Fails for a transform that is no motion, names no frames or a frame twice, or where there are too many frames.
  Result<void> Set(const Transform& transform);
  void Forget(std::string_view child);
  [[nodiscard]] const Link* Find(std::string_view child) const;
  // Changes with every change of a link.
  [[nodiscard]] std::uint64_t version() const { return version_; }
  [[nodiscard]] bool empty() const { return links_.empty(); }

 private:
  std::map<std::string, Link, std::less<>> links_;
  std::uint64_t version_ = 0;
};

// T_to_from over the links of the trees, the earlier tree first where two know a frame. Frames in `outside` are not
// passed: the way from a lidar to its robot does not lead through the odometry. Nothing where the frames are not
// connected.
[[nodiscard]] std::optional<Eigen::Isometry3d> FindMotion(std::span<const FrameTree* const> trees, std::string_view to,
                                                          std::string_view from, std::span<const std::string> outside);

}  // namespace cairn::ros2
