#include "server/slam/scan/beam_points.h"

#include <cmath>

namespace cairn::slam {

std::span<const Eigen::Vector2d> BeamDirections::Of(const Scan& scan) {
  const std::size_t beams = scan.ranges_m.size();
  if (first_rad_ != scan.angle_first_rad || step_rad_ != scan.angle_step_rad || directions_.size() != beams) {
    first_rad_ = scan.angle_first_rad;
    step_rad_ = scan.angle_step_rad;
    directions_.clear();
    directions_.reserve(beams);
    for (std::size_t beam = 0; beam < beams; ++beam) {
      const double bearing_rad = BearingOf(scan, beam);
      directions_.emplace_back(std::cos(bearing_rad), std::sin(bearing_rad));
    }
  }
  return directions_;
}

std::vector<BeamPoint> PointsOf(const Scan& scan) {
  std::vector<BeamPoint> points;
  points.reserve(scan.ranges_m.size());
  const Pose2& mount = scan.T_robot_laser;
  const double cos_mount = std::cos(mount.theta), sin_mount = std::sin(mount.theta);
  const double cos_tilt = std::cos(scan.tilt_rad);
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
    if (ClassifyRange(scan.ranges_m[beam], scan.range_min_m, scan.range_max_m) != BeamClass::kHit) continue;
    const double range = scan.ranges_m[beam];
    const double bearing_rad = BearingOf(scan, beam);
    const Eigen::Vector2d p = OnGround(range, bearing_rad, cos_tilt);
    points.push_back(
        {.p_robot = {mount.x + cos_mount * p.x() - sin_mount * p.y(), mount.y + sin_mount * p.x() + cos_mount * p.y()},
         .range_m = range,
         .bearing_rad = bearing_rad,
         .beam = static_cast<int>(beam)});
  }
  return points;
}

bool IsFullTurn(const Scan& scan) {
  const double step = std::abs(scan.angle_step_rad);
  return step * static_cast<double>(scan.ranges_m.size()) >= 2.0 * kPi - 0.5 * step;
}

}  // namespace cairn::slam
