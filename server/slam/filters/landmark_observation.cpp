#include "server/slam/filters/landmark_observation.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {

RangeBearing PredictRangeBearing(const Pose2& T_map_robot, const Eigen::Vector2d& p_map) {
  const double dx = p_map.x() - T_map_robot.x, dy = p_map.y() - T_map_robot.y;
  const double d2 = std::max(dx * dx + dy * dy, 1e-12);  // On top of the landmark the bearing is undefined.
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

}  // namespace cairn::slam
