// Finds the nearest surface point of a reference set. The plane is divided into square cells, which are
// mapped onto a torus of buckets, so that the number of buckets is fixed wherever the robot goes. Points of
// distant cells may share a bucket; they are told apart by their distance. A bucket holds at most
// kMaxInBucket points, far more than a wall that was seen forty times puts there, so that no scan can make
// the search slow. Thread rule: built by one thread, then read from any thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

class PointIndex {
 public:
  static constexpr std::uint16_t kMaxInBucket = 1000;

  // `cell_m` is the side of a cell, and the largest distance at which Nearest is sure to find a point.
  explicit PointIndex(double cell_m);

  void Clear();
  void Add(const SurfacePoint& point);  // A point whose bucket is full is left out.
  // The nearest point within max_distance_m, or null. REQUIRES: max_distance_m <= cell_m.
  [[nodiscard]] const SurfacePoint* Nearest(const Eigen::Vector2d& p, double max_distance_m) const;
  [[nodiscard]] std::size_t size() const { return points_.size(); }

 private:
  static constexpr int kSide = 256;  // Buckets per side of the torus.
  [[nodiscard]] static std::size_t Bucket(int x, int y);

  double cell_m_;
  std::vector<std::int32_t> heads_;    // Per bucket: index of its first point, or -1 if it is empty.
  std::vector<std::uint16_t> counts_;  // Per bucket: number of its points.
  std::vector<std::int32_t> next_;     // Per point: index of the next point in its bucket, or -1.
  std::vector<SurfacePoint> points_;
};

}  // namespace cairn::slam
