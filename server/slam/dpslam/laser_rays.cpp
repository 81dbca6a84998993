#include "server/slam/dpslam/laser_rays.h"

#include <algorithm>
#include <cmath>

#include "server/slam/scan/beam_points.h"

namespace cairn::slam {

LaserRays RaysOf(const Scan& scan, const OpacityOptions& options) {
  LaserRays result;
  result.origin_robot = scan.T_robot_laser.translation();
  const double cos_mount = std::cos(scan.T_robot_laser.theta), sin_mount = std::sin(scan.T_robot_laser.theta);
  const double cos_tilt = std::cos(scan.tilt_rad);
  const auto max_rays = static_cast<std::size_t>(options.max_rays);
  const std::size_t stride = (scan.ranges_m.size() + max_rays - 1) / max_rays;
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); beam += stride) {
    const BeamClass kind = ClassifyRange(scan.ranges_m[beam], scan.range_min_m, scan.range_max_m);
    if (kind == BeamClass::kInvalid) continue;
    LaserRay ray;
    ray.hit = kind == BeamClass::kHit;
    const double range =
        ray.hit ? static_cast<double>(scan.ranges_m[beam]) : std::min(options.no_return_m, scan.range_max_m);
    const double bearing = scan.angle_first_rad + static_cast<double>(beam) * scan.angle_step_rad;
    const Eigen::Vector2d end_laser = OnGround(range, bearing, cos_tilt);
    ray.length_m = end_laser.norm();
    if (!(ray.length_m > 1e-3)) continue;
    const Eigen::Vector2d along = end_laser / ray.length_m;
    ray.direction = {cos_mount * along.x() - sin_mount * along.y(), sin_mount * along.x() + cos_mount * along.y()};
    if (ray.length_m > options.max_ray_m) {
      ray.length_m = options.max_ray_m;
      ray.hit = false;
    }
    result.rays.push_back(ray);
  }
  return result;
}

}  // namespace cairn::slam
