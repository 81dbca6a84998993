#include "server/slam/matchers/ndt.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "common/geometry/pose_difference.h"
#include "server/slam/features/scan_view.h"

namespace cairn::slam {
namespace {

// Longest step, about a third of a cell: a longer one would leave the distributions for which the derivatives
// are valid.
constexpr double kLongestStepM = 0.3, kLongestStepRad = 0.15;
// Length of the last step: far below the noise of a laser, so that the exact end of the iteration does not
// matter.
constexpr double kStopStepM = 5e-5, kStopStepRad = 2e-5;

// A turn is weighted as the motion of a point at the typical distance, so that eigenvalues can be compared
// with each other.
double TypicalDistance(std::span<const Eigen::Vector2d> points) {
  double squares = 0.0;
  for (const Eigen::Vector2d& p : points) squares += p.squaredNorm();
  return std::sqrt(std::max(squares / static_cast<double>(std::max<std::size_t>(points.size(), 1)), 1e-2));
}

// Newton's step (2.16) towards the maximum. The absolute value of every curvature is used, so that the step
// leads uphill also where the score is not concave; where it is, this is the plain Newton step.
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

}  // namespace

void Visit(OptionVisitor& visitor, NewtonOptions& options) {
  visitor.Integer("max_iterations", options.max_iterations, "1", 1, 1000,
                  "Most iterations. A typical scan needs fewer than 12.");
}

void Visit(OptionVisitor& visitor, NdtCoarseOptions& options) {
  visitor.Real("cell_m", options.cell_m, "m", 0.0, 20.0,
               "Side of the cells in the first search. 0 leaves this search out.");
  visitor.Real("min_flatness", options.min_flatness, "1", 1e-6, 1.0,
               "Smallest ratio of the variances of a cell across and along a wall. A larger value finds walls from "
               "farther away.");
}

void Visit(OptionVisitor& visitor, NdtOptions& options) {
  visitor.Section("coarse", "A first search with larger cells and rounder distributions.",
                  [&] { Visit(visitor, options.coarse); });
  visitor.Section("map", "The normal distributions.", [&] { Visit(visitor, options.map); });
  visitor.Section("thinning", "Thinning of the scan that is matched with them.",
                  [&] { Visit(visitor, options.thinning); });
  visitor.Section("newton", "Newton's method.", [&] { Visit(visitor, options.newton); });
  visitor.Section("evidence", "When a match is accepted, and its covariance.",
                  [&] { Visit(visitor, options.evidence); });
  visitor.Require(options.coarse.cell_m == 0.0 || options.coarse.cell_m >= options.map.cell_m, "coarse.cell_m",
                  "must be 0 or at least", "map.cell_m");
}

NewtonResult ClimbNdt(const NdtMap& map, std::span<const Eigen::Vector2d> points, const Pose2& T_start,
                      const NewtonOptions& options) {
  NewtonResult result{T_start};
  const double distance = TypicalDistance(points);
  const auto is_short = [&](const Eigen::Vector3d& step) {
    return step.head<2>().norm() < kStopStepM && std::abs(step.z()) < kStopStepRad;
  };
  while (result.iterations < options.max_iterations && !result.settled) {
    ++result.iterations;
    const NdtDerivatives at = map.Derivatives(points, result.T_map_points);
    Eigen::Vector3d step = StepUphill(at, distance);
    if (!step.allFinite()) return result;
    const double excess = std::max(step.head<2>().norm() / kLongestStepM, std::abs(step.z()) / kLongestStepRad);
    if (excess > 1.0) step /= excess;
    while (!is_short(step) && map.Derivatives(points, Plus(result.T_map_points, step)).score <= at.score) step *= 0.5;
    result.settled = is_short(step);
    // The last, short step is not known to raise the score, so it is not applied.
    if (!result.settled) result.T_map_points = Plus(result.T_map_points, step);
  }
  return result;
}

MatchResult MatchByNdt(const ScanView& ref, const ScanView& curr, const MatchPrior& prior, const NdtOptions& options,
                       const ParallelFor& /*parallel_for*/) {
  const NdtMap map(PositionsOf(ref), options.map);
  const std::vector<Eigen::Vector2d> points = ThinByCentreOfGravity(PositionsOf(curr), options.thinning);
  if (map.empty() || points.size() < static_cast<std::size_t>(options.evidence.min_inliers))
    return UnmatchedNdt(prior, MatchFailure::kTooFewFeatures);
  Pose2 T_start = prior.T_ref_curr;
  int iterations = 0;
  if (options.coarse.cell_m > 0.0) {
    const NdtMap coarse(PositionsOf(ref), {.cell_m = options.coarse.cell_m,
                                           .min_points = options.map.min_points,
                                           .min_flatness = options.coarse.min_flatness});
    const NewtonResult climb = ClimbNdt(coarse, points, T_start, options.newton);
    T_start = climb.T_map_points;
    iterations = climb.iterations;
  }
  const NewtonResult climb = ClimbNdt(map, points, T_start, options.newton);
  MatchResult result = EvaluateNdtPose(map, points, climb.T_map_points, climb.settled, prior, options.evidence);
  result.iterations = iterations + climb.iterations;
  return result;
}

}  // namespace cairn::slam
