// Finds the nearest surface point of a reference set. Points hang in the cells of a torus of buckets, so the index has
// a fixed size wherever the robot goes; far points that share a bucket are told apart by distance. A bucket takes
// kMaxInBucket points, far more than walls seen forty times put there: no scan can make the search slow. Built once,
// then read from any thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/matching/surface_points.h"

namespace cairn::slam {

class PointIndex {
 public:
  static constexpr std::uint16_t kMaxInBucket = 1000;

  // `cell_m` is also the largest distance at which Nearest finds anything for sure.
  explicit PointIndex(double cell_m);

  void Clear();
  void Add(const SurfacePoint& point);  // Left out where the bucket is full.
  // The nearest point within max_distance_m (<= cell_m), or null.
  [[nodiscard]] const SurfacePoint* Nearest(const Eigen::Vector2d& p, double max_distance_m) const;
  [[nodiscard]] std::size_t size() const { return points_.size(); }

 private:
  static constexpr int kSide = 256;  // Buckets per side of the torus.
  [[nodiscard]] static std::size_t Bucket(int x, int y);

  double cell_m_;
  std::vector<std::int32_t> heads_;    // Per bucket: index of its first point, -1 none.
  std::vector<std::uint16_t> counts_;  // Per bucket.
  std::vector<std::int32_t> next_;     // Per point: the next one in its bucket.
  std::vector<SurfacePoint> points_;
};

}  // namespace cairn::slam
