#include "server/robots/pose_block.h"

#include <algorithm>
#include <utility>

#include "common/geometry/rotated_covariance.h"
#include "common/sensor/stamp.h"

namespace cairn::server {

PathMove::At PathMove::After(Stamp stamp) const {
  return std::upper_bound(knots.begin(), knots.end(), stamp,
                          [](Stamp value, const Knot& knot) { return value < knot.stamp; });
}

void PathMove::Apply(std::vector<PathPose>& poses) const {
  if (poses.empty()) return;
  At after = After(poses.front().stamp);
  for (PathPose& pose : poses) {
    while (after != knots.end() && after->stamp <= pose.stamp) ++after;
    Move(pose, after);
  }
}

void PathMove::Move(PathPose& pose, At after) const {
  if (fragment && (*fragment ? pose.localized : pose.reason == PoseReason::kNotJoined)) {
    pose.localized = !*fragment;
    pose.reason = *fragment ? PoseReason::kNotJoined : PoseReason::kTracking;
  }
  if (knots.empty() || (after == knots.end() && !moves_rest && pose.stamp > knots.back().stamp)) return;
  const Pose2 old = pose.T_map_robot;
  if (after == knots.begin() || after == knots.end()) {
    pose.T_map_robot = (after == knots.begin() ? knots.front() : knots.back()).T_new_old * old;
  } else {
    const Knot& before = *std::prev(after);
    const double fraction = static_cast<double>(NanosBetween(before.stamp, pose.stamp)) /
                            static_cast<double>(NanosBetween(before.stamp, after->stamp));
    pose.T_map_robot = Interpolate(before.T_new_old * old, after->T_new_old * old, fraction);
  }
  pose.T_map_odom = pose.T_map_robot * Between(old, pose.T_map_odom);
  pose.covariance = Rotated(pose.covariance, pose.T_map_robot.theta - old.theta);
}

bool PathMove::Changes(Stamp first, Stamp last) const {
  if (fragment) return true;
  At from = After(first);
  if (from != knots.begin()) --from;
  At to = After(last);
  if (to != knots.end()) ++to;
  return std::any_of(from, to, [](const Knot& knot) { return !(knot.T_new_old == Pose2{}); });
}

std::size_t PoseBlock::IndexFrom(Stamp stamp) const {
  Poses poses;
  {
    const MutexLock lock(mutex_);
    poses = poses_;
  }
  return static_cast<std::size_t>(
      std::lower_bound(poses->begin(), poses->end(), stamp,
                       [](const PathPose& pose, Stamp value) { return pose.stamp < value; }) -
      poses->begin());
}

PathPose PoseBlock::pose(std::size_t index) const {
  Moves moves;
  std::vector<PathPose> one;
  {
    const MutexLock lock(mutex_);
    if (moves_.empty()) return (*poses_)[index];
    one.push_back((*poses_)[index]);
    moves = moves_;
  }
  for (const auto& move : moves) move->Apply(one);
  return one.front();
}

const std::vector<PathPose>& PoseBlock::poses() const {
  const MutexLock lock(mutex_);
  if (!moves_.empty()) {
    std::vector<PathPose> moved = *poses_;
    for (const auto& move : moves_) move->Apply(moved);
    poses_ = std::make_shared<const std::vector<PathPose>>(std::move(moved));
    moves_.clear();
  }
  return *poses_;
}

std::shared_ptr<const PoseBlock> PoseBlock::Moved(const std::shared_ptr<const PoseBlock>& block,
                                                  const std::shared_ptr<const PathMove>& move) {
  if (block->empty() || !move->Changes(block->first_stamp(), block->last_stamp())) return block;
  Poses poses;
  Moves moves;
  {
    const MutexLock lock(block->mutex_);
    poses = block->poses_;
    moves = block->moves_;
  }
  if (moves.size() >= kMostMoves) {
    static_cast<void>(block->poses());
    const MutexLock lock(block->mutex_);
    poses = block->poses_;
    moves.clear();
  }
  moves.push_back(move);
  return std::shared_ptr<const PoseBlock>(new PoseBlock(std::move(poses), std::move(moves)));
}

}  // namespace cairn::server
