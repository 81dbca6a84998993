// How an estimator takes over a path that a job has found (mapper.h).
#include <algorithm>
#include <cmath>

#include "server/slam/graph/loop_graph.h"
#include "server/slam/mapper_state.h"

namespace cairn::slam {

// The poses of the keyframes with numbers below `made`, out of a path that may have more of these, because some were
// retired since. Empty if it lacks one.
std::vector<Pose2> Mapper::State::PosesOfFirst(std::uint64_t made, std::span<const Pose2> path,
                                               std::span<const std::uint64_t> numbers) const {
  std::vector<Pose2> poses;
  if (path.size() != (numbers.empty() ? made : numbers.size())) return poses;
  for (const std::uint64_t wanted : trail.numbers()) {
    if (wanted >= made) break;
    std::size_t at = static_cast<std::size_t>(wanted);
    if (!numbers.empty()) {
      at = static_cast<std::size_t>(std::ranges::lower_bound(numbers, wanted) - numbers.begin());
      if (at == numbers.size() || numbers[at] != wanted) return {};
    }
    poses.push_back(path[at]);
  }
  return poses;
}

// Takes the poses of the first keyframes from a job that knew `made` keyframes. How sure the filter is does not change:
// a robot whose map is switched again and again must not get worse by it.
void Mapper::State::Follow(std::span<const Pose2> first_poses, std::uint64_t made) {
  const std::vector<Pose2> before = believed_path().values();
  trail.ConfirmTentative();  // They are drawn in the grid that comes with the path.
  // The same path contradicts the scans as much or as little as before.
  if (std::ranges::equal(first_poses, std::span(before).first(first_poses.size()))) return;
  std::vector<Pose2> path(first_poses.begin(), first_poses.end());
  const std::size_t known = path.size();
  for (std::size_t k = known; k < before.size(); ++k)
    path.push_back(path[known - 1] * Between(before[known - 1], before[k]));
  KeepShape(path, known);
  if (drawing.changed_at() > made) {  // Large loops that the job did not know.
    OptimisePoses(path, trail.relations(), options.pose_graph);
  } else {
    FitRest(path, known);
  }
  MoveTo(path, before.back());
}

// Everything that hangs on the path follows it; `T_map_last` was its last pose.
void Mapper::State::MoveTo(std::span<const Pose2> path, const Pose2& T_map_last) {
  filter->MoveTo(path);
  self_check.Forget();
  const Pose2 T_new_old = path.back() * T_map_last.Inverse();
  recovery.Move(T_new_old);
  level.outcome.T_map_robot = T_new_old * level.outcome.T_map_robot;
  level.outcome.T_map_odom = T_new_old * level.outcome.T_map_odom;
}

// Places that were seen again correct the pose at once, and the way to them when the next large loop closes. No other
// one will. Other robots wait for the thread of this one: so the fit is that of a large loop, which takes milliseconds.
void Mapper::State::SettlePath() {
  const std::vector<PoseRelation> relations = trail.relations();
  if (localisation || !filter->rebases() || !filter->placed() || HasFewLoops(trail.measured())) return;
  std::vector<Pose2> path = believed_path().values();
  const Pose2 T_map_last = path.back();
  if (!options.pose_graph.enabled || !OptimiseLoopGraph(path, relations, options.pose_graph).usable) return;
  MoveTo(path, T_map_last);
  drawing.StartAgain(trail.made());
}

// A job may know more than the relations of this robot, such as what others have seen. Where it has changed the path,
// or one before it had, relations along the way keep what it has found when the next large loop closes. They take the
// place of those of earlier jobs. The next job does not take them for measurements: what it had found itself would
// count again with every job.
void Mapper::State::KeepShape(std::span<const Pose2> path, std::size_t known) {
  constexpr double kEveryM = 10.0;
  constexpr double kNoChange = 0.5;  // Standard deviations.
  const std::vector<Pose2> before = believed_path().values();
  std::vector<PoseRelation> shape = trail.relations();
  std::erase_if(shape, [](const PoseRelation& one) { return !KeepsShape(one); });
  const auto kept_before = [earlier = shape](std::size_t from, std::size_t to) {
    return std::ranges::any_of(earlier, [&](const PoseRelation& one) {
      return std::min(one.from, one.to) < to && std::max(one.from, one.to) > from;
    });
  };
  // What was not in the job stays.
  std::erase_if(shape, [known](const PoseRelation& one) { return std::max(one.from, one.to) < known; });
  std::size_t last = 0;
  for (std::size_t k = 1; k < known; ++k) {
    if (k + 1 < known && trail.shapes()[k].travelled_m - trail.shapes()[last].travelled_m < kEveryM) continue;
    const Pose2 T_last_k = Between(path[last], path[k]);
    const Pose2 change = Between(Between(before[last], before[k]), T_last_k);
    const bool changed =
        change.translation().norm() > kNoChange * kShapeSigmaM || std::abs(change.theta) > kNoChange * kShapeSigmaRad;
    if (changed || kept_before(last, k))
      shape.push_back({last, k, T_last_k, PoseCovariance(kShapeSigmaM, kShapeSigmaRad), true});
    last = k;
  }
  trail.SetShape(shape);
}

// What was driven since the job knew the path does not hang on the last of its poses alone: it must fit what was seen
// again of the first `known` keyframes.
void Mapper::State::FitRest(std::vector<Pose2>& path, std::size_t known) const {
  const auto holds = [known](const PoseRelation& one) {
    return one.loop && std::min(one.from, one.to) < known && std::max(one.from, one.to) >= known;
  };
  if (std::ranges::none_of(trail.relations(), holds)) return;
  OptimisePoses(path, trail.relations(), options.pose_graph, {}, known);
}

}  // namespace cairn::slam
