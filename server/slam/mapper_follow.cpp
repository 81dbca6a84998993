// The estimator takes the grid of a map version, and follows its path.
#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/mapper_state.h"

namespace cairn::slam {
namespace {

// The squared distance of a relation from a path, in standard deviations.
double ChiSquare(const PoseRelation& relation, std::span<const Pose2> path) {
  const Eigen::Vector3d error = ErrorOf(relation, path[relation.from], path[relation.to]).error;
  return error.dot(relation.covariance.llt().solve(error));
}

}  // namespace

bool Mapper::AdoptGrid(OccupancyGrid grid, const GivenPath& given) {
  State& s = *state_;
  std::vector<Pose2> first_poses;
  if (s.filter->rebases() && s.filter->placed()) first_poses = s.PosesOfFirst(given);
  const bool follows = !first_poses.empty();
  if (given.made > s.trail.made() && !follows) return false;
  const std::uint64_t known = std::min(given.made, s.trail.made());
  if (follows) s.Follow(first_poses, known, given.followed);
  s.drawing.Adopt(std::move(grid), known, s.trail.CountBelow(known), s.trail.keyframes(), s.believed_path(), follows);
  return true;
}

// The poses of the keyframes with numbers below `made`, out of a path that may have more of these, because some were
// retired since. Empty if it lacks one.
std::vector<Pose2> Mapper::State::PosesOfFirst(const GivenPath& given) const {
  std::vector<Pose2> poses;
  const std::span<const std::uint64_t> numbers = given.numbers;
  if (given.path.size() != (numbers.empty() ? given.made : numbers.size())) return poses;
  for (const std::uint64_t wanted : trail.numbers()) {
    if (wanted >= given.made) break;
    std::size_t at = static_cast<std::size_t>(wanted);
    if (!numbers.empty()) {
      at = static_cast<std::size_t>(std::ranges::lower_bound(numbers, wanted) - numbers.begin());
      if (at == numbers.size() || numbers[at] != wanted) return {};
    }
    poses.push_back(given.path[at]);
  }
  return poses;
}

// Takes the poses of the first keyframes from a map version, as after a large loop. It knew `made` keyframes.
void Mapper::State::Follow(std::span<const Pose2> first_poses, std::uint64_t made, bool followed) {
  const std::vector<Pose2> before = believed_path().values();
  std::vector<Pose2> path(first_poses.begin(), first_poses.end());
  const std::size_t known = path.size();
  for (std::size_t k = known; k < before.size(); ++k)
    path.push_back(path[known - 1] * Between(before[known - 1], before[k]));
  const bool shaped = trail.keeps_shape();
  trail.DropKeptShape();
  if (!followed) KeepShape(path, known, shaped ? OwnPath(before) : before);
  const bool knows_all_loops = drawing.changed_at() <= made;
  if (!knows_all_loops || !FitRest(path, known, before)) {
    OptimisePoses(path, trail.relations(), options.pose_graph);
    drawing.StartAgain(trail.made());
  }
  filter->Rebase(path);
  trail.ConfirmTentative();
  self_check.Forget();
  const Pose2 T_new_old = path.back() * before.back().Inverse();
  recovery.Move(T_new_old);
  level.outcome.T_map_robot = T_new_old * level.outcome.T_map_robot;
  level.outcome.T_map_odom = T_new_old * level.outcome.T_map_odom;
}

// The path that the robot's own relations give it, without what a map version knew. The search begins at `path`.
std::vector<Pose2> Mapper::State::OwnPath(std::vector<Pose2> path) const {
  const std::vector<PoseRelation> relations = trail.relations();
  if (!relations.empty()) {
    OptimisePoses(path, relations, options.pose_graph);
    return path;
  }
  const Pose2 T_map_track = path.front() * trail.shapes().front().T_track_robot.Inverse();
  for (std::size_t k = 0; k < path.size(); ++k) path[k] = T_map_track * trail.shapes()[k].T_track_robot;
  return path;
}

// A job may know more than the relations of this robot, such as what others have seen. Where that has changed the path
// that these alone give (`own`), relations along the way keep what it has found when the next large loop closes. Only
// the path of the job itself is kept so: what was added to it later may be bent by any loop.
void Mapper::State::KeepShape(std::span<const Pose2> path, std::size_t known, std::span<const Pose2> own) {
  constexpr double kEveryM = 10.0;
  // More certain than the steps over this way, so that they do not pull it back. Half of this is no change.
  constexpr double kSigmaM = 0.02, kSigmaRad = 0.002;
  std::size_t last = 0;
  for (std::size_t k = 1; k < known; ++k) {
    if (k + 1 < known && trail.shapes()[k].travelled_m - trail.shapes()[last].travelled_m < kEveryM) continue;
    const Pose2 T_last_k = Between(path[last], path[k]);
    const Pose2 change = Between(Between(own[last], own[k]), T_last_k);
    if (change.translation().norm() > 0.5 * kSigmaM || std::abs(change.theta) > 0.5 * kSigmaRad)
      trail.AddLoop({last, k, T_last_k, PoseCovariance(kSigmaM, kSigmaRad), true, true});
    last = k;
  }
}

// The version holds the first `known` keyframes, and stays as it is. Where the robot has seen some of these again
// later, what it has driven since must lie so that this still fits: it does not hang on the last of them alone. False
// if that tears a relation that fitted `before`: then the version itself contradicts what was seen since.
bool Mapper::State::FitRest(std::vector<Pose2>& path, std::size_t known, std::span<const Pose2> before) const {
  constexpr double kTorn = 16.3;  // Chi-square with three degrees of freedom: one in a thousand.
  const std::vector<PoseRelation> relations = trail.relations();
  const auto crosses = [known](const PoseRelation& one) {
    return one.loop && std::min(one.from, one.to) < known && known <= std::max(one.from, one.to);
  };
  if (std::ranges::none_of(relations, crosses)) return true;
  OptimisePoses(path, relations, options.pose_graph, {}, known);
  return std::ranges::none_of(relations, [&](const PoseRelation& one) {
    return crosses(one) && ChiSquare(one, path) > ChiSquare(one, before) + kTorn;
  });
}

}  // namespace cairn::slam
