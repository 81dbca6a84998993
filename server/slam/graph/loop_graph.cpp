#include "server/slam/graph/loop_graph.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "common/geometry/pose_difference.h"
#include "server/slam/graph/block_cholesky.h"
#include "server/slam/graph/loop_loss.h"

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

// The least squares over the ends of the runs.
class EndsFit {
 public:
  EndsFit(std::size_t nodes, std::span<const PoseRelation> relations)
      : relations_(relations), steps_(nodes), directions_(nodes), system_(nodes, EdgesOf(relations)) {
    informations_.reserve(relations.size());
    for (const PoseRelation& relation : relations) informations_.push_back(relation.covariance.inverse());
  }

  // Half the sum of the squared normalised errors, those of loops after the robust loss of this width.
  double CostAt(const std::vector<Pose2>& poses, double loss_width) { return Look<false>(poses, loss_width); }
  // The same, and sets the linear system up for Step.
  double LineariseAt(const std::vector<Pose2>& poses, double loss_width) { return Look<true>(poses, loss_width); }

  // Moves the poses by a step of Gauss and Newton. False if the system has no solution. REQUIRES: they are those of the
  // last call of LineariseAt; each call is good for one step.
  [[nodiscard]] bool Step(std::vector<Pose2>& poses) {
    if (!system_.Factorise()) return false;
    system_.Solve(steps_);
    for (std::size_t k = 1; k < poses.size(); ++k) poses[k] = Plus(poses[k], steps_[k]);
    return true;
  }

 private:
  static std::vector<BlockCholesky::Edge> EdgesOf(std::span<const PoseRelation> relations) {
    std::vector<BlockCholesky::Edge> edges;
    edges.reserve(relations.size());
    for (const PoseRelation& relation : relations)
      edges.push_back({static_cast<std::uint32_t>(relation.from), static_cast<std::uint32_t>(relation.to)});
    return edges;
  }

  template <bool kLinearise>
  double Look(const std::vector<Pose2>& poses, double loss_width) {
    for (std::size_t k = 0; k < poses.size(); ++k)
      directions_[k] = {std::cos(poses[k].theta), std::sin(poses[k].theta)};
    if constexpr (kLinearise) {
      system_.SetZero();
      std::ranges::fill(steps_, Eigen::Vector3d::Zero());
      system_.AddToDiagonal(0, 1e12 * Eigen::Matrix3d::Identity());  // The first node stays where it is.
    }
    double cost = 0.0;
    for (std::size_t i = 0; i < relations_.size(); ++i) {
      const PoseRelation& relation = relations_[i];
      const Pose2& from = poses[relation.from];
      const Pose2& to = poses[relation.to];
      const double c = directions_[relation.from].x(), s = directions_[relation.from].y();
      const double dx = to.x - from.x, dy = to.y - from.y;
      const double x = c * dx + s * dy, y = c * dy - s * dx;  // Where `to` is, seen from `from`.
      const Eigen::Vector3d error(x - relation.T_from_to.x, y - relation.T_from_to.y,
                                  WrapAngle(to.theta - from.theta - relation.T_from_to.theta));
      const Eigen::Matrix3d& information = informations_[i];
      const Eigen::Vector3d weighted = information * error;
      const double squared = error.dot(weighted);
      double weight = 1.0;
      if (relation.loop) {
        const double squared_width = loss_width * loss_width;
        cost += squared_width * std::log1p(squared / squared_width);
        weight = 1.0 / (1.0 + squared / squared_width);
      } else {
        cost += squared;
      }
      if constexpr (kLinearise) {
        Eigen::Matrix3d J_from, J_to;
        J_from << -c, -s, y, s, -c, -x, 0.0, 0.0, -1.0;
        J_to << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0;
        const Eigen::Matrix3d I_J_from = weight * (information * J_from), I_J_to = weight * (information * J_to);
        system_.AddToDiagonal(relation.from, J_from.transpose() * I_J_from);
        system_.AddToDiagonal(relation.to, J_to.transpose() * I_J_to);
        system_.AddToEdge(i, J_from.transpose() * I_J_to);
        steps_[relation.from].noalias() -= weight * (J_from.transpose() * weighted);
        steps_[relation.to].noalias() -= weight * (J_to.transpose() * weighted);
      }
    }
    return 0.5 * cost;
  }

  std::span<const PoseRelation> relations_;
  std::vector<Eigen::Matrix3d> informations_;
  std::vector<Eigen::Vector3d> steps_;       // Before they are solved for: the right side of the system.
  std::vector<Eigen::Vector2d> directions_;  // Cosine and sine of the headings.
  BlockCholesky system_;
};

// As OptimisePoses, but with one step each while the loss is wide: the last width has to converge, those before it only
// have to bring the loops to where it counts them.
PoseGraphSummary FitEnds(std::vector<Pose2>& poses, std::span<const PoseRelation> relations,
                         const PoseGraphOptions& options) {
  PoseGraphSummary result;
  if (poses.size() < 2 || relations.empty()) return result;
  EndsFit fit(poses.size(), relations);
  std::vector<Pose2> moved = poses;
  result.cost_before = fit.CostAt(poses, kLoopLoss);
  for (const double widening : {kLoopLossWidening * kLoopLossWidening, kLoopLossWidening}) {
    fit.LineariseAt(moved, widening * kLoopLoss);
    if (!fit.Step(moved)) return result;
    ++result.iterations;
  }
  double cost = fit.LineariseAt(moved, kLoopLoss);
  for (std::int64_t i = 0; i < options.max_iterations; ++i) {
    std::vector<Pose2> next = moved;
    if (!fit.Step(next)) return result;
    ++result.iterations;
    const double cost_next = fit.LineariseAt(next, kLoopLoss);
    if (!(cost_next < cost)) break;
    const bool converged = cost - cost_next < options.tolerance * cost;
    moved = std::move(next);
    cost = cost_next;
    if (converged) break;
  }
  result.cost_after = cost;
  result.usable = result.cost_after <= result.cost_before;
  if (result.usable) poses = std::move(moved);
  return result;
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

  const std::vector<Pose2> guess = end_poses;
  PoseGraphSummary summary = FitEnds(end_poses, between_ends, options);
  if (!summary.usable) {  // Steps without damping can miss from a bad guess.
    end_poses = guess;
    summary = OptimisePoses(end_poses, between_ends, options);
  }
  if (!summary.usable) return summary;
  for (std::size_t i = 0; i < ends.size(); ++i) poses[ends[i]] = end_poses[i];
  for (std::size_t i = 1; i < ends.size(); ++i)
    if (ends[i] > ends[i - 1] + 1) FillRun(steps, ends[i - 1], ends[i], poses);
  return summary;
}

}  // namespace cairn::slam
