#include "common/cloud/scan_points3.h"

#include <cmath>

namespace cairn {

void AppendPoints(const Scan& scan, const ScanPlacing& placing, double max_range_m, PointCloud* cloud) {
  const Pose2 T_map_laser = placing.T_map_robot * scan.T_robot_laser;
  const Eigen::Matrix2d R = T_map_laser.rotation();
  const double cos_tilt = std::cos(scan.tilt_rad), sin_tilt = std::sin(scan.tilt_rad);
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    if (ClassifyRange(scan.ranges_m[i], scan.range_min_m, scan.range_max_m) != BeamClass::kHit) continue;
    const double range = scan.ranges_m[i];
    if (range > max_range_m) continue;
    const double bearing = scan.angle_first_rad + static_cast<double>(i) * scan.angle_step_rad;
    const double x = range * std::cos(bearing), y = range * std::sin(bearing);
    const Eigen::Vector2d p = T_map_laser.translation() + R * Eigen::Vector2d(x * cos_tilt, y);
    cloud->emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()),
                        static_cast<float>(placing.height_m - x * sin_tilt));
  }
}

}  // namespace cairn
