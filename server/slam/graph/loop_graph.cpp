#include "server/slam/graph/loop_graph.h"

#include <Eigen/Cholesky>
#include <cstddef>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

using Steps = std::vector<const PoseRelation*>;

bool IsStep(const PoseRelation& relation) {
  return !relation.loop && relation.to == relation.from + 1;
}

// The relation between the nodes `first` and `last`, which the steps lead to; step k ends at node k.
PoseRelation Composed(const Steps& steps, std::size_t first, std::size_t last) {
  PoseRelation run{first, last, {}, Eigen::Matrix3d::Zero(), false};
  for (std::size_t k = first + 1; k <= last; ++k) {
    const Eigen::Matrix3d J_run = J_compose_left(run.T_from_to, steps[k]->T_from_to);
    const Eigen::Matrix3d J_step = J_compose_right(run.T_from_to, steps[k]->T_from_to);
    run.covariance = J_run * run.covariance * J_run.transpose() + J_step * steps[k]->covariance * J_step.transpose();
    run.T_from_to = run.T_from_to * steps[k]->T_from_to;
  }
  run.covariance = 0.5 * (run.covariance + run.covariance.transpose()).eval();
  return run;
}

// Sets the poses between `first` and `last`, which stay: the most likely ones by the steps.
void FillRun(const Steps& steps, std::size_t first, std::size_t last, std::vector<Pose2>& poses) {
  constexpr int kIterations = 2;  // The second one changes what the first one has left, which is of second order.
  const std::size_t count = last - first;
  const Pose2 T_first_last = Between(poses[first], poses[last]);
  std::vector<Pose2> T_step(count), T_first(count + 1);
  std::vector<Eigen::Matrix3d> J_end_step(count);
  for (std::size_t i = 0; i < count; ++i) T_step[i] = steps[first + 1 + i]->T_from_to;
  const auto chain = [&] {
    for (std::size_t i = 0; i < count; ++i) T_first[i + 1] = T_first[i] * T_step[i];
  };
  chain();
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < count; ++i) {
      J_end_step[i] = J_compose_left(T_first[i + 1], Between(T_first[i + 1], T_first[count])) *
                      J_compose_right(T_first[i], T_step[i]);
      covariance += J_end_step[i] * steps[first + 1 + i]->covariance * J_end_step[i].transpose();
    }
    const Eigen::Vector3d pull = covariance.ldlt().solve(Minus(T_first_last, T_first[count]));
    for (std::size_t i = 0; i < count; ++i)
      T_step[i] = Plus(T_step[i], steps[first + 1 + i]->covariance * J_end_step[i].transpose() * pull);
    chain();
  }
  for (std::size_t i = 1; i < count; ++i) poses[first + i] = poses[first] * T_first[i];
}

}  // namespace

PoseGraphSummary OptimiseLoopGraph(std::vector<Pose2>& poses, std::span<const PoseRelation> relations,
                                   const PoseGraphOptions& options) {
  Steps steps(poses.size() + 1, nullptr);  // By the node at which it ends.
  std::vector<int> relations_at(poses.size());
  for (const PoseRelation& relation : relations) {
    ++relations_at[relation.from], ++relations_at[relation.to];
    if (IsStep(relation)) steps[relation.to] = &relation;
  }
  const auto within_run = [&](std::size_t k) {
    return relations_at[k] == 2 && steps[k] != nullptr && steps[k + 1] != nullptr;
  };
  std::vector<std::size_t> ends, index(poses.size());
  std::vector<Pose2> end_poses;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (within_run(k)) continue;
    index[k] = ends.size();
    ends.push_back(k);
    end_poses.push_back(poses[k]);
  }
  std::vector<PoseRelation> between_ends;
  const auto add = [&](PoseRelation relation) {
    relation.from = index[relation.from];
    relation.to = index[relation.to];
    between_ends.push_back(relation);
  };
  for (const PoseRelation& relation : relations)
    if (!within_run(relation.from) && !within_run(relation.to)) add(relation);
  for (std::size_t i = 1; i < ends.size(); ++i)
    if (ends[i] > ends[i - 1] + 1) add(Composed(steps, ends[i - 1], ends[i]));

  const PoseGraphSummary summary = OptimisePoses(end_poses, between_ends, options);
  if (!summary.usable) return summary;
  for (std::size_t i = 0; i < ends.size(); ++i) poses[ends[i]] = end_poses[i];
  for (std::size_t i = 1; i < ends.size(); ++i)
    if (ends[i] > ends[i - 1] + 1) FillRun(steps, ends[i - 1], ends[i], poses);
  return summary;
}

}  // namespace cairn::slam
