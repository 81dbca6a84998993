// How crisp a map is that scans were put together to: a figure for places without a true map or a true path. The points
// around a place are taken for a normal distribution, and a wall that is blurred, or drawn twice, makes it wider.
// - Mean map entropy: the mean over places of 0.5 ln det(2 pi e S), where S is the covariance of the points within a
//   radius around the place. Lower is crisper; it is below 0 where the distributions are narrow.
// - Thickness: the median over places of the standard deviation across the wall, the square root of the smaller
//   eigenvalue of S. The papers' mean of its square is governed by corners and clutter.
// Both depend on the place, so only maps of the same scans can be compared. A wall that is drawn twice, farther apart
// than the radius, is not seen.
// Sources: Razlaw, Droeschel, Holz, Behnke, ECMR 2015 (mean map entropy, mean plane variance); Droeschel, Behnke, ICRA
// 2018. There in space, here in the plane.
#pragma once

#include <cstddef>

#include "common/cloud/point_cloud.h"
#include "common/status.h"

namespace cairn {

struct MapEntropyOptions {
  double radius_m = 0.3;  // How far around a place its points are taken.
};

struct MapCrispness {
  std::size_t places = 0;  // Those with enough points around them.
  double mean_entropy = 0.0;
  double thickness_m = 0.0;
};

// Of a cloud of level scans; z is not looked at. REQUIRES: the cloud is thinned (CloudOptions::voxel_m), so that a wall
// counts by its area and not by how often it was seen. Points that are not finite, or beyond 1,000 km, are left out.
// Up to twice 50,000 places are looked at, in even steps along the cloud. kInvalidArgument: the radius is not within
// 0.001..1000 m. kFailedPrecondition: nowhere are 10 points within the radius. Stateless, thread-safe.
[[nodiscard]] Result<MapCrispness> MapEntropy(const PointCloud& cloud, const MapEntropyOptions& options = {});

}  // namespace cairn
