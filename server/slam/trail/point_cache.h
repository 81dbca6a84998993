// The surface points of the keyframes that were looked at last, for a trail that has far more keyframes than points fit
// into memory. Those not looked at for the longest time go first; whoever asks for them again computes them again from
// the scan, which gives the same points. Bounded by the number of points. Not thread-safe.
#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <unordered_map>
#include <vector>

#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

// Never changes; it stays valid for as long as somebody holds it.
using SharedPoints = std::shared_ptr<const std::vector<SurfacePoint>>;

class PointCache {
 public:
  // 32 bytes each.
  explicit PointCache(std::size_t max_points) : max_points_(max_points) {}
  // A copy begins without points.
  PointCache(const PointCache& other) : max_points_(other.max_points_) {}
  PointCache& operator=(const PointCache& other) { return *this = PointCache(other); }
  PointCache(PointCache&&) = default;
  PointCache& operator=(PointCache&&) = default;
  ~PointCache() = default;

  // The points of a keyframe; null if they are not here.
  [[nodiscard]] SharedPoints Find(std::size_t keyframe);
  // Keeps the points, and lets others go. Those of one keyframe stay even if they are more than `max_points`. REQUIRES:
  // the keyframe's points are not here.
  SharedPoints Keep(std::size_t keyframe, std::vector<SurfacePoint> points);
  void Clear();

  [[nodiscard]] std::size_t points() const { return points_; }

 private:
  struct Kept {
    std::size_t keyframe = 0;
    SharedPoints points;
  };

  std::size_t max_points_;
  std::size_t points_ = 0;
  std::list<Kept> kept_;  // The one looked at last comes first.
  std::unordered_map<std::size_t, std::list<Kept>::iterator> by_keyframe_;
};

}  // namespace cairn::slam
