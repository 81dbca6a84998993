#include "tests/studies/filters/corner_world.h"

#include <cmath>

namespace cairn::studies {

slam::ScanView SeenCorners(const std::vector<Corner>& corners, const Pose2& T_map_robot,
                           const slam::LandmarkNoise& noise, double factor, slam::Rng& rng) {
  slam::ScanView view;
  for (const Corner& corner : corners) {
    const Eigen::Vector2d p_robot = T_map_robot.Inverse() * corner.p_map;
    if (p_robot.norm() > kCornerSightM || std::abs(std::atan2(p_robot.y(), p_robot.x())) > kPi / 2) continue;
    const double range = p_robot.norm() + factor * noise.range_m * slam::NormalDraw(rng);
    const double bearing = std::atan2(p_robot.y(), p_robot.x()) + factor * noise.bearing_rad * slam::NormalDraw(rng);
    slam::LineFeature line;
    line.slope = WrapAngle(corner.slope - T_map_robot.theta + factor * noise.slope_rad * slam::NormalDraw(rng));
    slam::CornerFeature seen;
    seen.position = range * Eigen::Vector2d(std::cos(bearing), std::sin(bearing));
    seen.real = true;
    seen.angle = corner.angle;
    seen.line_a = static_cast<int>(view.features.lines.size());
    view.features.lines.push_back(line);
    view.features.corners.push_back(seen);
  }
  return view;
}

}  // namespace cairn::studies
