// How far a cloud lies from the rectangles of the world it was taken in: the distance of each point to the nearest of
// them. Walls that the cloud does not show are not counted. Frame of both: `map`. Stateless.
#pragma once

#include "client/sim/rectangle_tree.h"
#include "common/cloud/point_cloud.h"

namespace cairn::sim {

struct CloudError {
  std::size_t points = 0;
  double mean_m = 0.0;
  double rms_m = 0.0;
  double median_m = 0.0;
  double p95_m = 0.0;
  double max_m = 0.0;
};

// All zero for an empty cloud. REQUIRES at least one rectangle.
[[nodiscard]] CloudError MeasureCloud(const PointCloud& cloud, const RectangleTree& truth);

}  // namespace cairn::sim
