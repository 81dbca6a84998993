// A landmark as the mapper publishes it: that of the best hypothesis, in `map`.
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace cairn::slam {

struct Landmark {
  std::uint64_t id = 0;  // Of no other landmark now; it may be given to another one later.
  bool corner = false;
  Eigen::Vector2d p_map = Eigen::Vector2d::Zero();
  double direction_rad = 0.0;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  std::uint32_t sightings = 0;
};

}  // namespace cairn::slam
