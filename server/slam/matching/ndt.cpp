#include "server/slam/matching/ndt.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "server/slam/matching/scan_points.h"

namespace cairn::slam {
namespace {

// A turn weighs as the motion of a point at the typical distance: then one eigenvalue can be compared with another.
double TypicalDistance(std::span<const Eigen::Vector2d> points) {
  double squares = 0.0;
  for (const Eigen::Vector2d& p : points) squares += p.squaredNorm();
  return std::sqrt(std::max(squares / static_cast<double>(std::max<std::size_t>(points.size(), 1)), 1e-2));
}

// Newton's step (2.16) uphill. Every curvature counts by its size, so the step climbs also where the score is not
// concave; where it is, this is the plain Newton step.
Eigen::Vector3d StepUphill(const NdtDerivatives& at, double distance) {
  const Eigen::Vector3d scale(1.0, 1.0, 1.0 / distance);
  const Eigen::Matrix3d H = scale.asDiagonal() * -at.hessian * scale.asDiagonal();
  const Eigen::Vector3d g = scale.cwiseProduct(at.gradient);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(H);
  const Eigen::Vector3d sizes = solver.eigenvalues().cwiseAbs();
  const double floor = std::max(1e-3 * sizes.maxCoeff(), 1e-9);
  const Eigen::Vector3d along = solver.eigenvectors().transpose() * g;
  return scale.cwiseProduct(solver.eigenvectors() * along.cwiseQuotient(sizes.cwiseMax(floor)));
}

Pose2 Moved(const Pose2& T, const Eigen::Vector3d& step) {
  return {T.x + step.x(), T.y + step.y(), WrapAngle(T.theta + step.z())};
}

}  // namespace

void Visit(OptionVisitor& visitor, NewtonOptions& options) {
  visitor.Integer("max_iterations", options.max_iterations, "1", 1, 1000, "Hard bound; typical scans stop below 12.");
  visitor.Real("longest_step_m", options.longest_step_m, "m", 1e-3, 10.0, "A longer step is shortened.");
  visitor.Real("longest_step_rad", options.longest_step_rad, "rad", 1e-3, kPi, "A longer step is shortened.");
  visitor.Real("stop_step_m", options.stop_step_m, "m", 1e-9, 0.1, "Stops when steps are smaller than both.");
  visitor.Real("stop_step_rad", options.stop_step_rad, "rad", 1e-9, 0.1, "See stop_step_m.");
}

void Visit(OptionVisitor& visitor, NdtCoarseOptions& options) {
  visitor.Real("cell_m", options.cell_m, "m", 0.0, 20.0, "Side of its cells; 0: none.");
  visitor.Real("min_flatness", options.min_flatness, "1", 1e-6, 1.0, "Larger: wider walls, found from farther off.");
}

void Visit(OptionVisitor& visitor, NdtOptions& options) {
  visitor.Section("coarse", "A first climb on larger, rounder cells.", [&] { Visit(visitor, options.coarse); });
  visitor.Section("map", "The distributions.", [&] { Visit(visitor, options.map); });
  visitor.Section("thinning", "Of the scan laid on them.", [&] { Visit(visitor, options.thinning); });
  visitor.Section("newton", "The climb to the densest place.", [&] { Visit(visitor, options.newton); });
  visitor.Section("evidence", "When the answer counts, and how sure it is.", [&] { Visit(visitor, options.evidence); });
}

NewtonResult ClimbNdt(const NdtMap& map, std::span<const Eigen::Vector2d> points, const Pose2& T_start,
                      const NewtonOptions& options) {
  NewtonResult result{T_start};
  const double distance = TypicalDistance(points);
  const auto is_short = [&](const Eigen::Vector3d& step) {
    return step.head<2>().norm() < options.stop_step_m && std::abs(step.z()) < options.stop_step_rad;
  };
  while (result.iterations < options.max_iterations && !result.settled) {
    ++result.iterations;
    const NdtDerivatives at = map.Derivatives(points, result.T_map_points);
    Eigen::Vector3d step = StepUphill(at, distance);
    if (!step.allFinite()) return result;
    const double excess =
        std::max(step.head<2>().norm() / options.longest_step_m, std::abs(step.z()) / options.longest_step_rad);
    if (excess > 1.0) step /= excess;
    while (!is_short(step) && map.Derivatives(points, Moved(result.T_map_points, step)).score <= at.score) step *= 0.5;
    result.settled = is_short(step);
    // The last, short step is not proven to climb: it is not taken.
    if (!result.settled) result.T_map_points = Moved(result.T_map_points, step);
  }
  return result;
}

MatchResult MatchByNdt(const ScanView& prev, const ScanView& curr, const MatchPrior& prior, const NdtOptions& options,
                       const ParallelFor& /*parallel_for*/) {
  const NdtMap map(PositionsOf(prev), options.map);
  const std::vector<Eigen::Vector2d> points = ThinByCentreOfGravity(PositionsOf(curr), options.thinning);
  if (map.empty() || points.size() < static_cast<std::size_t>(options.evidence.min_inliers))
    return UnmatchedNdt(prior, MatchFailure::kTooFewFeatures);
  Pose2 T_start = prior.T_prev_curr;
  int iterations = 0;
  if (options.coarse.cell_m > 0.0) {
    const NdtMap coarse(PositionsOf(prev), {.cell_m = options.coarse.cell_m,
                                            .min_points = options.map.min_points,
                                            .min_flatness = options.coarse.min_flatness});
    const NewtonResult climb = ClimbNdt(coarse, points, T_start, options.newton);
    T_start = climb.T_map_points;
    iterations = climb.iterations;
  }
  const NewtonResult climb = ClimbNdt(map, points, T_start, options.newton);
  MatchResult result = JudgeNdtPose(map, points, climb.T_map_points, climb.settled, prior, options.evidence);
  result.iterations = iterations + climb.iterations;
  return result;
}

}  // namespace cairn::slam
