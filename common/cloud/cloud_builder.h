// Gathers a cloud from scans and the path a robot took: each scan is placed at the path's pose at its stamp, between
// two poses that are near enough in time. Thinned to one point per cube of `voxel_m`, so that memory grows with the
// space that was seen and not with the time. Bounded. Deterministic. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <unordered_set>

#include "common/cloud/point_cloud.h"
#include "common/sensor/scan.h"
#include "common/sensor/trajectory.h"
#include "common/status.h"

namespace cairn {

// The hits of a scan as points in space: the scan plane, turned about the laser's y axis by the tilt, placed where the
// robot stood on a flat floor. Where the scan was swept while the robot moved, each beam is placed at the pose between
// those of the first and the last one. Stateless, thread-safe. REQUIRES a scan that passed ValidateScan. Source: thesis
// C 3.3, 5.4 (points of space from poses of the plane); (r, alpha, beta) of 4.3.2.
struct ScanPlacing {
  Pose2 T_map_robot;      // At the first beam.
  double height_m = 0.0;  // Height of the laser's tilt axis above the floor.
  // At the last beam; nothing if the robot stood, or all beams are of one time.
  std::optional<Pose2> T_map_robot_last{};
};

// Appends one point per hit within `max_range_m`, in the order of the beams.
void AppendPoints(const Scan& scan, const ScanPlacing& placing, double max_range_m, PointCloud* cloud);

struct CloudOptions {
  double height_m = 0.0;     // Height of the scanner above the floor.
  double max_range_m = 1e4;  // Farther hits are left out.
  double voxel_m = 0.0;      // 0: every point is kept.
  // Longest time between the two poses around a scan; with more, the scan is left out. Where the path has no pose at
  // the last beam of a scan, all its beams are placed at that of the first.
  double max_pose_gap_s = 1.0;
  bool tilted_only = false;              // Leave out level scans.
  std::size_t max_points = 100'000'000;  // 1.2 GB.
};
[[nodiscard]] Result<void> Validate(const CloudOptions& options);

class CloudBuilder {
 public:
  // Both must be valid; the path is kept by reference and must outlive the builder.
  CloudBuilder(const Trajectory& path, const CloudOptions& options);

  // Scans that are not valid, or stand where the path has no pose, are counted and left out. kResourceExhausted beyond
  // max_points.
  [[nodiscard]] Result<void> Add(const Scan& scan);

  [[nodiscard]] const PointCloud& cloud() const { return cloud_; }
  [[nodiscard]] std::int64_t scans_used() const { return used_; }
  [[nodiscard]] std::int64_t scans_tilted() const { return tilted_; }  // Among the scans used.
  [[nodiscard]] std::int64_t scans_level() const { return level_; }    // Left out by tilted_only.
  [[nodiscard]] std::int64_t scans_invalid() const { return invalid_; }
  [[nodiscard]] std::int64_t scans_without_pose() const { return without_pose_; }

 private:
  void Thin(std::size_t first);

  const Trajectory& path_;
  const CloudOptions options_;
  PointCloud cloud_;
  std::unordered_set<std::uint64_t> taken_;  // Cubes that have their point.
  std::int64_t used_ = 0, tilted_ = 0, level_ = 0, invalid_ = 0, without_pose_ = 0;
};

}  // namespace cairn
