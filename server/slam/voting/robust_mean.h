// The weighted mean of Tables 3.27 and 3.31: the value farthest from the mean is removed, one at a time,
// until all remaining values lie within `spread` of their mean, or only `keep` values remain. Stateless,
// thread-safe.
// Source: thesis A 3.5.12.2-3.5.12.3.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace cairn::slam {

struct WeightedVector {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  double weight = 0.0;
};

struct RobustMean {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double spread = 0.0;  // Largest distance from the mean among the values kept.
  int kept = 0;         // 0 if there were no values of positive weight.
};

// For plain numbers leave the second component 0.
[[nodiscard]] RobustMean MeanWithoutOutliers(std::vector<WeightedVector> values, double spread, int keep);

}  // namespace cairn::slam
