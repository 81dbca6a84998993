#include "server/slam/graph/pose_graph.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <memory>

#include "common/geometry/pose_difference.h"
#include "server/slam/graph/loop_loss.h"

namespace cairn::slam {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

class RelationCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit RelationCost(const PoseRelation& relation) : relation_(relation) {
    // The whitening matrix W satisfies W' W = covariance^-1.
    const Eigen::Matrix3d L = relation.covariance.llt().matrixL();
    whitening_ = L.triangularView<Eigen::Lower>().solve(Eigen::Matrix3d::Identity());
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const auto pose = [](const double* p) { return Pose2{p[0], p[1], WrapAngle(p[2])}; };
    const PoseRelationError at = ErrorOf(relation_, pose(parameters[0]), pose(parameters[1]));
    Eigen::Map<Eigen::Vector3d>{residuals} = whitening_ * at.error;
    if (jacobians != nullptr) {
      if (jacobians[0] != nullptr) Eigen::Map<RowMajor3>{jacobians[0]} = whitening_ * at.J_error_from;
      if (jacobians[1] != nullptr) Eigen::Map<RowMajor3>{jacobians[1]} = whitening_ * at.J_error_to;
    }
    return true;
  }

 private:
  PoseRelation relation_;
  Eigen::Matrix3d whitening_;
};

class CancelCallback final : public ceres::IterationCallback {
 public:
  explicit CancelCallback(const std::function<bool()>& go_on) : go_on_(go_on) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return go_on_() ? ceres::SOLVER_CONTINUE : ceres::SOLVER_ABORT;
  }

 private:
  const std::function<bool()>& go_on_;
};

}  // namespace

void Visit(OptionVisitor& visitor, PoseGraphOptions& options) {
  visitor.Flag(
      "enabled", options.enabled,
      "Whether smoothing fits all relations by least squares. If not, its answer is the path of the best particle.");
  visitor.Integer("max_iterations", options.max_iterations, "1", 1, 1000,
                  "Most iterations of the least squares in each of its three steps.");
}

bool HasFewLoops(std::span<const PoseRelation> relations) {
  constexpr std::ptrdiff_t kFew = 10;
  return std::ranges::count_if(relations, &PoseRelation::loop) <= kFew;
}

double LoopWeight(double squared_error) {
  return 1.0 / (1.0 + squared_error / (kLoopLoss * kLoopLoss));
}

PoseRelationError ErrorOf(const PoseRelation& relation, const Pose2& T_map_from, const Pose2& T_map_to) {
  const Pose2 T_from_map = T_map_from.Inverse();
  const Pose2 T_from_to = T_from_map * T_map_to;
  PoseRelationError result;
  result.error = Minus(T_from_to, relation.T_from_to);
  result.J_error_from = J_compose_left(T_from_map, T_map_to) * J_inverse(T_map_from);
  result.J_error_to = J_compose_right(T_from_map, T_map_to);
  return result;
}

PoseGraphSummary OptimisePoses(std::vector<Pose2>& poses, std::span<const PoseRelation> relations,
                               const PoseGraphOptions& options, const std::function<bool()>& go_on, std::size_t held) {
  PoseGraphSummary result;
  if (poses.size() < 2 || relations.empty()) return result;
  std::vector<std::array<double, 3>> blocks;
  blocks.reserve(poses.size());
  for (const Pose2& pose : poses) blocks.push_back({pose.x, pose.y, pose.theta});

  // All loops share one loss, so that it can be narrowed for all of them at once.
  ceres::LossFunctionWrapper loop_loss(nullptr, ceres::TAKE_OWNERSHIP);
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  for (const PoseRelation& relation : relations) {
    if (std::max(relation.from, relation.to) < held) continue;
    problem.AddResidualBlock(new RelationCost(relation),  // The problem takes ownership of the cost.
                             relation.loop ? &loop_loss : nullptr, blocks[relation.from].data(),
                             blocks[relation.to].data());
  }
  if (problem.NumResidualBlocks() == 0) return result;
  for (std::size_t k = 0; k < std::min(held, blocks.size()); ++k)
    if (problem.HasParameterBlock(blocks[k].data())) problem.SetParameterBlockConstant(blocks[k].data());
  const auto narrow_to = [&](double widening) {
    loop_loss.Reset(new ceres::CauchyLoss(widening * kLoopLoss), ceres::TAKE_OWNERSHIP);
  };

  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  solver.max_num_iterations = static_cast<int>(options.max_iterations);
  solver.function_tolerance = options.tolerance;
  // A very large trust region makes the steps nearly Gauss-Newton: the chain of steps is well conditioned,
  // and a small first region would cost many iterations.
  solver.initial_trust_region_radius = 1e10;
  solver.max_trust_region_radius = 1e16;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  CancelCallback cancellation(go_on);
  if (go_on) solver.callbacks.push_back(&cancellation);

  narrow_to(1.0);
  problem.Evaluate({}, &result.cost_before, nullptr, nullptr, nullptr);
  for (const double widening : {kLoopLossWidening * kLoopLossWidening, kLoopLossWidening, 1.0}) {
    narrow_to(widening);
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
    if (summary.termination_type == ceres::USER_FAILURE) {
      result.cancelled = true;
      return result;
    }
    if (!summary.IsSolutionUsable()) return result;
    result.iterations += static_cast<int>(summary.iterations.size());
    result.cost_after = summary.final_cost;
  }
  result.usable = result.cost_after <= result.cost_before;
  if (!result.usable) return result;
  for (std::size_t k = held; k < poses.size(); ++k) poses[k] = {blocks[k][0], blocks[k][1], WrapAngle(blocks[k][2])};
  return result;
}

}  // namespace cairn::slam
