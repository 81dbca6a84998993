#include "server/slam/scan/point_index.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {

PointIndex::PointIndex(double cell_m) : cell_m_(cell_m), heads_(kSide * kSide, -1), counts_(kSide * kSide, 0) {}

std::size_t PointIndex::Bucket(int x, int y) {
  return static_cast<std::size_t>((y & (kSide - 1)) * kSide + (x & (kSide - 1)));
}

void PointIndex::Clear() {
  std::fill(heads_.begin(), heads_.end(), -1);
  std::fill(counts_.begin(), counts_.end(), std::uint16_t{0});
  next_.clear();
  points_.clear();
}

void PointIndex::Add(const SurfacePoint& point) {
  const std::size_t bucket =
      Bucket(static_cast<int>(std::floor(point.p.x() / cell_m_)), static_cast<int>(std::floor(point.p.y() / cell_m_)));
  if (counts_[bucket] == kMaxInBucket) return;
  ++counts_[bucket];
  next_.push_back(heads_[bucket]);
  heads_[bucket] = static_cast<std::int32_t>(points_.size());
  points_.push_back(point);
}

const SurfacePoint* PointIndex::Nearest(const Eigen::Vector2d& p, double max_distance_m) const {
  const SurfacePoint* nearest = nullptr;
  double best = max_distance_m * max_distance_m;
  const int x_low = static_cast<int>(std::floor((p.x() - max_distance_m) / cell_m_));
  const int x_high = static_cast<int>(std::floor((p.x() + max_distance_m) / cell_m_));
  const int y_low = static_cast<int>(std::floor((p.y() - max_distance_m) / cell_m_));
  const int y_high = static_cast<int>(std::floor((p.y() + max_distance_m) / cell_m_));
  for (int y = y_low; y <= y_high; ++y) {
    for (int x = x_low; x <= x_high; ++x) {
      for (std::int32_t i = heads_[Bucket(x, y)]; i >= 0; i = next_[static_cast<std::size_t>(i)]) {
        const SurfacePoint& candidate = points_[static_cast<std::size_t>(i)];
        const double distance = (candidate.p - p).squaredNorm();
        if (distance < best) {
          best = distance;
          nearest = &candidate;
        }
      }
    }
  }
  return nearest;
}

}  // namespace cairn::slam
