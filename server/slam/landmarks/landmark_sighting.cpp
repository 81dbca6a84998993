#include "server/slam/landmarks/landmark_sighting.h"

#include <algorithm>

namespace cairn::slam {

bool Alike(const LandmarkSignature& a, const LandmarkSignature& b, const LandmarkOptions& options) {
  if (a.corner != b.corner) return false;
  return a.corner ? std::abs(AngleDiff(a.shape, b.shape)) < options.same_angle_rad
                  : std::abs(a.shape - b.shape) < options.same_length_m;
}

bool SlopesAgree(const LandmarkSighting& sighting, double robot_heading, double landmark_slope,
                 const LandmarkSignature& landmark, const LandmarkOptions& options) {
  const double first = AngleDiff(landmark_slope, robot_heading + sighting.slope);
  if (std::abs(first) > options.match_slope_rad) return false;
  if (!landmark.corner) return true;
  return std::abs(WrapAngle(first + landmark.shape - sighting.signature.shape)) <= options.match_slope_rad;
}

RangeBearing PredictRangeBearing(const Pose2& T_map_robot, const Eigen::Vector2d& p_map) {
  const double dx = p_map.x() - T_map_robot.x, dy = p_map.y() - T_map_robot.y;
  const double d2 = std::max(dx * dx + dy * dy, 1e-12);  // At the landmark itself the bearing is undefined.
  const double d = std::sqrt(d2);
  RangeBearing predicted;
  predicted.z = {d, AngleDiff(std::atan2(dy, dx), T_map_robot.theta)};
  predicted.J_z_pose << -dx / d, -dy / d, 0, dy / d2, -dx / d2, -1;
  predicted.J_z_point << dx / d, dy / d, -dy / d2, dx / d2;
  return predicted;
}

Eigen::Vector2d MeasureRangeBearing(const Eigen::Vector2d& p_robot) {
  return {p_robot.norm(), std::atan2(p_robot.y(), p_robot.x())};
}

Eigen::Matrix2d J_point_z(const Pose2& T_map_robot, const Eigen::Vector2d& z) {
  const double course = T_map_robot.theta + z.y();
  Eigen::Matrix2d J;
  J << std::cos(course), -z.x() * std::sin(course), std::sin(course), z.x() * std::cos(course);
  return J;
}

}  // namespace cairn::slam
