#include "server/robots/pose_history.h"

#include <algorithm>
#include <cmath>
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
    return candidate->last_stamp() < value;
  });
  const PoseBlock& poses = block == full_->end() ? *tail_ : **block;
  const std::size_t index = poses.IndexFrom(stamp);
  const PathPose after = poses.pose(index);
  if (after.stamp == stamp) return after;
  const PathPose before =
      index == 0 ? (*std::prev(block))->pose((*std::prev(block))->size() - 1) : poses.pose(index - 1);
  const double fraction = static_cast<double>(NanosBetween(before.stamp, stamp)) /
                          static_cast<double>(NanosBetween(before.stamp, after.stamp));
  const PathPose& worse = before.score < after.score ? before : after;
  const auto share = static_cast<float>(fraction);
  return PathPose{stamp,
                  Interpolate(before.T_map_robot, after.T_map_robot, fraction),
                  worse.score,
                  before.localized && after.localized,
                  worse.reason,
                  (1.0F - share) * before.covariance + share * after.covariance,
                  Interpolate(before.T_map_odom, after.T_map_odom, fraction)};
}

void PoseHistory::Append(const PathPose& pose) {
  if (size_ > 0 && pose.stamp <= (tail_.empty() ? full_->back()->last_stamp() : tail_.back().stamp)) return;
  tail_.push_back(pose);
  ++size_;
  if (tail_.size() == kBlockPoses) {
    std::vector<PathView::Block> full = *full_;
    full.push_back(std::make_shared<const PoseBlock>(std::move(tail_)));
    full_ = std::make_shared<const std::vector<PathView::Block>>(std::move(full));
    tail_.clear();
  }
  if (size_ > max_poses_) ThinOlderHalf();
  for (std::size_t i = 0; i < kMovedPerAppend && moved_ < full_->size(); ++i)
    static_cast<void>((*full_)[moved_++]->poses());
}

void PoseHistory::Clear() {
  full_ = std::make_shared<const std::vector<PathView::Block>>();
  tail_ = {};
  size_ = moved_ = 0;
}

PathView PoseHistory::view() const {
  return {full_, std::make_shared<const PoseBlock>(tail_)};
}

std::vector<PathMove::Knot> PoseHistory::KnotsOf(std::span<const StampedPose> now) const {
  constexpr double kStaysM = 1e-3, kStaysRad = 1e-4;
  const PathView path = view();
  std::vector<PathMove::Knot> knots;
  knots.reserve(now.size());
  for (const StampedPose& one : now) {
    const auto old = path.At(one.stamp);
    if (!old || (!knots.empty() && one.stamp <= knots.back().stamp)) continue;
    const Pose2 step = Between(old->T_map_robot, one.T_map_robot);
    const bool stays = step.translation().norm() < kStaysM && std::abs(step.theta) < kStaysRad;
    knots.push_back({one.stamp, stays ? Pose2{} : one.T_map_robot * old->T_map_robot.Inverse()});
  }
  return knots;
}

void PoseHistory::MoveOnto(std::span<const StampedPose> now, bool moves_rest, std::optional<bool> fragment) {
  if (size_ == 0) return;
  auto move = std::make_shared<PathMove>();
  *move = {KnotsOf(now), moves_rest, fragment};
  if (!tail_.empty() && move->Changes(tail_.front().stamp, tail_.back().stamp)) move->Apply(tail_);
  std::vector<PathView::Block> full;
  full.reserve(full_->size());
  for (const PathView::Block& block : *full_) full.push_back(PoseBlock::Moved(block, move));
  if (full == *full_) return;
  full_ = std::make_shared<const std::vector<PathView::Block>>(std::move(full));
  moved_ = 0;
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
  return std::all_of(full_->begin(), full_->end(),
                     [&](const PathView::Block& block) { return goes_on(block->poses()); }) &&
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
      const std::vector<PathPose>& poses = full[j]->poses();
      for (std::size_t k = 0; k < poses.size(); k += 2) kept.push_back(poses[k]);
    }
    thinned.push_back(std::make_shared<const PoseBlock>(std::move(kept)));
  }
  thinned.insert(thinned.end(), full.begin() + static_cast<std::ptrdiff_t>(half), full.end());
  size_ = tail_.size();
  for (const auto& block : thinned) size_ += block->size();
  full_ = std::make_shared<const std::vector<PathView::Block>>(std::move(thinned));
  moved_ = 0;
}

}  // namespace cairn::server
