#include "server/robots/pose_history.h"

#include <algorithm>
#include <functional>

#include "server/slam/scan/stamp_gate.h"

namespace cairn::server {

static_assert(sizeof(PathPose) == 104);  // The text of robots.max_path_poses names this size.

std::size_t PathView::size() const {
  std::size_t size = 0;
  for (const Block& block : blocks_) size += block->size();
  return size;
}

std::optional<PathPose> PathView::At(Stamp stamp) const {
  if (empty() || stamp < first_stamp() || stamp > last_stamp()) return std::nullopt;
  const auto block = std::find_if(blocks_.begin(), blocks_.end(),
                                  [stamp](const Block& candidate) { return candidate->back().stamp >= stamp; });
  const auto after = std::lower_bound((*block)->begin(), (*block)->end(), stamp,
                                      [](const PathPose& pose, Stamp value) { return pose.stamp < value; });
  if (after->stamp == stamp) return *after;
  const PathPose& before = after == (*block)->begin() ? (*std::prev(block))->back() : *std::prev(after);
  const double fraction = static_cast<double>(slam::NanosBetween(before.stamp, stamp)) /
                          static_cast<double>(slam::NanosBetween(before.stamp, after->stamp));
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

Trajectory PathView::ToTrajectory() const {
  Trajectory all;
  all.reserve(size());
  for (const Block& block : blocks_) {
    for (const PathPose& pose : *block) all.push_back({pose.stamp, pose.T_map_robot});
  }
  return all;
}

void PoseHistory::Append(const PathPose& pose) {
  const bool none_yet = tail_.empty() && full_.empty();
  const Stamp last = none_yet ? 0 : tail_.empty() ? full_.back()->back().stamp : tail_.back().stamp;
  if (!none_yet && pose.stamp <= last) return;
  tail_.push_back(pose);
  ++size_;
  if (tail_.size() == kBlockPoses) {
    full_.push_back(std::make_shared<const std::vector<PathPose>>(std::move(tail_)));
    tail_.clear();
  }
  if (size_ > max_poses_) ThinOlderHalf();
}

PathView PoseHistory::view() const {
  std::vector<PathView::Block> blocks = full_;
  if (!tail_.empty()) blocks.push_back(std::make_shared<const std::vector<PathPose>>(tail_));
  return PathView(std::move(blocks));
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
  return std::all_of(full_.begin(), full_.end(), [&](const PathView::Block& block) { return goes_on(*block); }) &&
         goes_on(tail_);
}

void PoseHistory::ThinOlderHalf() {
  // Pairs of blocks become one, so blocks stay full and their number halves with the poses.
  std::vector<PathView::Block> thinned;
  const std::size_t half = full_.size() / 2;
  for (std::size_t i = 0; i < half; i += 2) {
    std::vector<PathPose> kept;
    for (std::size_t j = i; j < std::min(i + 2, half); ++j) {
      for (std::size_t k = 0; k < full_[j]->size(); k += 2) kept.push_back((*full_[j])[k]);
    }
    thinned.push_back(std::make_shared<const std::vector<PathPose>>(std::move(kept)));
  }
  thinned.insert(thinned.end(), full_.begin() + static_cast<std::ptrdiff_t>(half), full_.end());
  full_ = std::move(thinned);
  size_ = tail_.size();
  for (const auto& block : full_) size_ += block->size();
}

}  // namespace cairn::server
