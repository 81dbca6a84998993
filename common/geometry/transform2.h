// A pose that moves many points: T * p with the sine and the cosine computed once, the same number to the last bit.
// Plain value; thread-safe.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "common/geometry/pose2.h"

namespace cairn {

class Transform2 {
 public:
  explicit Transform2(const Pose2& T_a_b)
      : x_(T_a_b.x), y_(T_a_b.y), cos_(std::cos(T_a_b.theta)), sin_(std::sin(T_a_b.theta)) {}

  [[nodiscard]] Eigen::Vector2d operator*(const Eigen::Vector2d& p_b) const {
    return {x_ + cos_ * p_b.x() - sin_ * p_b.y(), y_ + sin_ * p_b.x() + cos_ * p_b.y()};
  }

 private:
  double x_, y_;
  double cos_, sin_;
};

}  // namespace cairn
