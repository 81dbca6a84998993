#include "server/slam/scan/beam_points.h"

#include <cmath>

namespace cairn::slam {

std::vector<BeamPoint> PointsOf(const Scan& scan) {
  std::vector<BeamPoint> points;
  points.reserve(scan.ranges_m.size());
  const Pose2& mount = scan.T_robot_laser;
  const double cos_mount = std::cos(mount.theta), sin_mount = std::sin(mount.theta);
  const double cos_tilt = std::cos(scan.tilt_rad);
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
    if (ClassifyRange(scan.ranges_m[beam], scan.range_min_m, scan.range_max_m) != BeamClass::kHit) continue;
    const double range = scan.ranges_m[beam];
    const double bearing = scan.angle_first_rad + static_cast<double>(beam) * scan.angle_step_rad;
    const Eigen::Vector2d p = OnGround(range, bearing, cos_tilt);
    points.push_back(
        {.p_robot = {mount.x + cos_mount * p.x() - sin_mount * p.y(), mount.y + sin_mount * p.x() + cos_mount * p.y()},
         .range_m = range,
         .bearing_rad = bearing,
         .beam = static_cast<int>(beam)});
  }
  return points;
}

bool IsFullTurn(const Scan& scan) {
  const double step = std::abs(scan.angle_step_rad);
  return step * static_cast<double>(scan.ranges_m.size()) >= 2.0 * kPi - 0.5 * step;
}

}  // namespace cairn::slam
