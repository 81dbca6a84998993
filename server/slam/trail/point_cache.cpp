#include "server/slam/trail/point_cache.h"

#include <utility>

namespace cairn::slam {

SharedPoints PointCache::Find(std::size_t keyframe) {
  const auto found = by_keyframe_.find(keyframe);
  if (found == by_keyframe_.end()) return nullptr;
  kept_.splice(kept_.begin(), kept_, found->second);
  return kept_.front().points;
}

SharedPoints PointCache::Keep(std::size_t keyframe, std::vector<SurfacePoint> points) {
  points.shrink_to_fit();  // They were collected in memory for every beam of the scan.
  points_ += points.size();
  kept_.push_front({keyframe, std::make_shared<const std::vector<SurfacePoint>>(std::move(points))});
  by_keyframe_[keyframe] = kept_.begin();
  while (points_ > max_points_ && kept_.size() > 1) {
    points_ -= kept_.back().points->size();
    by_keyframe_.erase(kept_.back().keyframe);
    kept_.pop_back();
  }
  return kept_.front().points;
}

void PointCache::Clear() {
  kept_.clear();
  by_keyframe_.clear();
  points_ = 0;
}

}  // namespace cairn::slam
