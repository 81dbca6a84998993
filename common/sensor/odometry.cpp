#include "common/sensor/odometry.h"

#include <cmath>
#include <string>

namespace cairn {

Result<void> ValidateOdometry(const Odometry& odometry) {
  constexpr double kFarthest = 1e7;  // m
  const Pose2& pose = odometry.T_odom_robot;
  if (!pose.IsFinite()) return Fail(StatusCode::kInvalidArgument, "odometry pose is not finite");
  for (const double coordinate : {pose.x, pose.y}) {
    if (std::abs(coordinate) > kFarthest) {
      return Fail(StatusCode::kInvalidArgument, "odometry pose is out of range (" + std::to_string(coordinate) + " m)");
    }
  }
  // Beyond this a wrapped angle has no correct digits left.
  if (std::abs(pose.theta) > kFarthest) {
    return Fail(StatusCode::kInvalidArgument, "odometry heading is out of range (" + std::to_string(pose.theta) + ")");
  }
  return {};
}

}  // namespace cairn
