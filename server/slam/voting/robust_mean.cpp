#include "server/slam/voting/robust_mean.h"

#include <algorithm>

namespace cairn::slam {

RobustMean MeanWithoutOutliers(std::vector<WeightedVector> values, double spread, int keep) {
  std::erase_if(values, [](const WeightedVector& v) { return !(v.weight > 0.0) || !v.value.allFinite(); });
  RobustMean result;
  while (!values.empty()) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weight = 0.0;
    for (const WeightedVector& v : values) sum += v.weight * v.value, weight += v.weight;
    result.mean = sum / weight;
    const auto farthest = std::max_element(values.begin(), values.end(), [&](const auto& a, const auto& b) {
      return (a.value - result.mean).squaredNorm() < (b.value - result.mean).squaredNorm();
    });
    result.spread = (farthest->value - result.mean).norm();
    result.kept = static_cast<int>(values.size());
    if (result.spread <= spread || result.kept <= keep) break;
    values.erase(farthest);
  }
  return result;
}

}  // namespace cairn::slam
