#include "server/robots/pose_history.h"

#include <algorithm>
#include <functional>

#include "server/slam/scan/stamp_gate.h"

namespace cairn::server {

static_assert(sizeof(PathPose) == 104);  // The text of robots.max_path_poses names this size.

std::size_t PathView::size() const {
  std::size_t size = tail_->size();
  for (const Block& block : *full_) size += block->size();
  return size;
}

std::optional<PathPose> PathView::At(Stamp stamp) const {
  if (empty() || stamp < first_stamp() || stamp > last_stamp()) return std::nullopt;
  const auto block = std::lower_bound(full_->begin(), full_->end(), stamp, [](const Block& candidate, Stamp value) {
    return candidate->back().stamp < value;
  });
  const std::vector<PathPose>& poses = block == full_->end() ? *tail_ : **block;
  const auto after = std::lower_bound(poses.begin(), poses.end(), stamp,
                                      [](const PathPose& pose, Stamp value) { return pose.stamp < value; });
  if (after->stamp == stamp) return *after;
  const PathPose& before = after == poses.begin() ? (*std::prev(block))->back() : *std::prev(after);
  const double fraction = static_cast<double>(NanosBetween(before.stamp, stamp)) /
                          static_cast<double>(NanosBetween(before.stamp, after->stamp));
  const PathPose& worse = before.score < after->score ? before : *after;
  const auto share = static_cast<float>(fraction);
  return PathPose{stamp,
                  Interpolate(before.T_map_robot, after->T_map_robot, fraction),
                  worse.score,
                  before.localized && after->localized,
                  worse.reason,
                  (1.0F - share) * before.covariance + share * after->covariance,
                  Interpolate(before.T_map_odom, after->T_map_odom, fraction)};
}

void PoseHistory::Append(const PathPose& pose) {
  if (size_ > 0 && pose.stamp <= (tail_.empty() ? full_->back()->back() : tail_.back()).stamp) return;
  tail_.push_back(pose);
  ++size_;
  if (tail_.size() == kBlockPoses) {
    std::vector<PathView::Block> full = *full_;
    full.push_back(std::make_shared<const std::vector<PathPose>>(std::move(tail_)));
    full_ = std::make_shared<const std::vector<PathView::Block>>(std::move(full));
    tail_.clear();
  }
  if (size_ > max_poses_) ThinOlderHalf();
}

PathView PoseHistory::view() const {
  return {full_, std::make_shared<const std::vector<PathPose>>(tail_)};
}

bool PoseHistory::Grows() const {
  const auto later = [](const PathPose& a, const PathPose& b) { return a.stamp < b.stamp; };
  const auto sorted = [&later](const std::vector<PathPose>& poses) {
    return std::adjacent_find(poses.begin(), poses.end(), std::not_fn(later)) == poses.end();
  };
  const PathPose* last = nullptr;
  const auto goes_on = [&](const std::vector<PathPose>& poses) {
    if (poses.empty()) return true;
    if ((last != nullptr && !later(*last, poses.front())) || !sorted(poses)) return false;
    last = &poses.back();
    return true;
  };
  return std::all_of(full_->begin(), full_->end(), [&](const PathView::Block& block) { return goes_on(*block); }) &&
         goes_on(tail_);
}

void PoseHistory::ThinOlderHalf() {
  // Pairs of blocks become one, so blocks stay full and their number halves with the poses.
  const std::vector<PathView::Block>& full = *full_;
  std::vector<PathView::Block> thinned;
  const std::size_t half = full.size() / 2;
  for (std::size_t i = 0; i < half; i += 2) {
    std::vector<PathPose> kept;
    for (std::size_t j = i; j < std::min(i + 2, half); ++j) {
      for (std::size_t k = 0; k < full[j]->size(); k += 2) kept.push_back((*full[j])[k]);
    }
    thinned.push_back(std::make_shared<const std::vector<PathPose>>(std::move(kept)));
  }
  thinned.insert(thinned.end(), full.begin() + static_cast<std::ptrdiff_t>(half), full.end());
  size_ = tail_.size();
  for (const auto& block : thinned) size_ += block->size();
  full_ = std::make_shared<const std::vector<PathView::Block>>(std::move(thinned));
}

}  // namespace cairn::server
