// The hits of a scan as points in space: the scan plane, turned about the laser's y axis by the tilt, placed where the
// robot stood on a flat floor. Where the scan was swept while the robot moved, the pose is that of its first beam: a
// robot halts for a tilted scan. Stateless, thread-safe. REQUIRES a scan that passed ValidateScan. Source: thesis
// C 3.3, 5.4 (points of space from poses of the plane); (r, alpha, beta) of 4.3.2.
#pragma once

#include "common/cloud/point_cloud.h"
#include "common/sensor/scan.h"

namespace cairn {

struct ScanPlacing {
  Pose2 T_map_robot;
  double height_m = 0.0;  // Height of the laser's tilt axis above the floor.
};

// Appends one point per hit within `max_range_m`, in the order of the beams.
void AppendPoints(const Scan& scan, const ScanPlacing& placing, double max_range_m, PointCloud* cloud);

}  // namespace cairn
