#include "client/sim/cloud_error.h"

#include <algorithm>
#include <cmath>

namespace cairn::sim {

CloudError MeasureCloud(const PointCloud& cloud, const RectangleTree& truth) {
  CloudError error;
  error.points = cloud.size();
  if (cloud.empty()) return error;
  std::vector<float> distances;
  distances.reserve(cloud.size());
  double sum = 0.0, squares = 0.0;
  for (const Eigen::Vector3f& point : cloud) {
    const double distance = truth.Distance(point.cast<double>());
    distances.push_back(static_cast<float>(distance));
    sum += distance;
    squares += distance * distance;
    error.max_m = std::max(error.max_m, distance);
  }
  const auto count = static_cast<double>(cloud.size());
  error.mean_m = sum / count;
  error.rms_m = std::sqrt(squares / count);
  const auto rank = [&](double share) {
    const auto nth = distances.begin() + static_cast<std::ptrdiff_t>(share * (count - 1));
    std::nth_element(distances.begin(), nth, distances.end());
    return static_cast<double>(*nth);
  };
  error.median_m = rank(0.5);
  error.p95_m = rank(0.95);
  return error;
}

}  // namespace cairn::sim
