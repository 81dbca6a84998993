// Takes the first point of each cell of a raster. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <unordered_set>

namespace cairn::slam {

class OnePerCell {
 public:
  explicit OnePerCell(double cell_m) : cell_m_(cell_m) {}

  bool Takes(const Eigen::Vector2d& p) {
    const auto x = static_cast<std::int64_t>(std::floor(p.x() / cell_m_));
    const auto y = static_cast<std::int64_t>(std::floor(p.y() / cell_m_));
    return taken_.insert((x << 32) ^ (y & 0xffffffff)).second;
  }

 private:
  double cell_m_;
  std::unordered_set<std::int64_t> taken_;
};

}  // namespace cairn::slam
