#include "common/cloud/cloud_builder.h"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

// 21 bits an axis: cubes of 1 cm within +-10 km.
std::uint64_t CubeOf(const Eigen::Vector3f& p, double voxel_m) {
  constexpr double kHalf = 1 << 20;
  std::uint64_t cube = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double index = std::clamp(std::floor(static_cast<double>(p(axis)) / voxel_m) + kHalf, 0.0, 2 * kHalf - 1);
    cube = (cube << 21) | static_cast<std::uint64_t>(index);
  }
  return cube;
}

}  // namespace

void AppendPoints(const Scan& scan, const ScanPlacing& placing, double max_range_m, PointCloud* cloud) {
  Pose2 T_map_laser = placing.T_map_robot * scan.T_robot_laser;
  Eigen::Matrix2d R = T_map_laser.rotation();
  const double cos_tilt = std::cos(scan.tilt_rad), sin_tilt = std::sin(scan.tilt_rad);
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    if (ClassifyRange(scan.ranges_m[i], scan.range_min_m, scan.range_max_m) != BeamClass::kHit) continue;
    const double range = scan.ranges_m[i];
    if (range > max_range_m) continue;
    if (placing.T_map_robot_last) {
      const double share = static_cast<double>(i) / static_cast<double>(scan.ranges_m.size() - 1);
      T_map_laser = Interpolate(placing.T_map_robot, *placing.T_map_robot_last, share) * scan.T_robot_laser;
      R = T_map_laser.rotation();
    }
    const double bearing = scan.angle_first_rad + static_cast<double>(i) * scan.angle_step_rad;
    const double x = range * std::cos(bearing), y = range * std::sin(bearing);
    const Eigen::Vector2d p = T_map_laser.translation() + R * Eigen::Vector2d(x * cos_tilt, y);
    cloud->emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()),
                        static_cast<float>(placing.height_m - x * sin_tilt));
  }
}

Result<void> Validate(const CloudOptions& o) {
  if (!(std::abs(o.height_m) <= 1000.0)) return Fail(StatusCode::kInvalidArgument, "cloud: height beyond +-1000 m");
  if (!(o.max_range_m > 0.0)) return Fail(StatusCode::kInvalidArgument, "cloud: the range limit must be above 0");
  if (!(o.voxel_m == 0.0 || (o.voxel_m >= 0.001 && o.voxel_m <= 100.0)))
    return Fail(StatusCode::kInvalidArgument, "cloud: cubes must be 0 (none) or 0.001..100 m");
  if (!(o.max_pose_gap_s > 0.0)) return Fail(StatusCode::kInvalidArgument, "cloud: the pose gap must be above 0");
  return {};
}

CloudBuilder::CloudBuilder(const Trajectory& path, const CloudOptions& options) : path_(path), options_(options) {}

Result<void> CloudBuilder::Add(const Scan& scan) {
  if (!ValidateScan(scan)) {
    ++invalid_;
    return {};
  }
  if (options_.tilted_only && scan.tilt_rad == 0.0) {
    ++level_;
    return {};
  }
  const auto T_map_robot = PoseOn(path_, scan.stamp, options_.max_pose_gap_s);
  if (!T_map_robot) {
    ++without_pose_;
    return {};
  }
  ++used_;
  tilted_ += scan.tilt_rad != 0.0;
  const std::size_t first = cloud_.size();
  ScanPlacing placing{*T_map_robot, options_.height_m};
  const double duration_s = scan.beam_period_s * static_cast<double>(scan.ranges_m.size() - 1);
  if (duration_s > 0.0)
    placing.T_map_robot_last = PoseOn(path_, scan.stamp + StampFromSeconds(duration_s), options_.max_pose_gap_s);
  AppendPoints(scan, placing, options_.max_range_m, &cloud_);
  if (options_.voxel_m > 0.0) Thin(first);
  if (cloud_.size() > options_.max_points)
    return Fail(StatusCode::kResourceExhausted,
                "more than " + std::to_string(options_.max_points) + " points: thin them, or limit the range");
  return {};
}

void CloudBuilder::Thin(std::size_t first) {
  std::size_t kept = first;
  for (std::size_t i = first; i < cloud_.size(); ++i)
    if (taken_.insert(CubeOf(cloud_[i], options_.voxel_m)).second) cloud_[kept++] = cloud_[i];
  cloud_.resize(kept);
}

}  // namespace cairn
