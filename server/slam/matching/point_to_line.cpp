#include "server/slam/matching/point_to_line.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "server/slam/matching/degeneracy.h"

namespace cairn::slam {
namespace {

// Normal equations of the linearised point-to-line errors at one pose, with what the pairs look like.
struct Linearisation {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d H_surfaces = Eigen::Matrix3d::Zero();  // Of the pairs with a surface direction alone.
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  int pairs = 0;
  int inliers = 0;
};

Linearisation Linearise(std::span<const SurfacePoint> points_robot, const PointIndex& reference,
                        const Pose2& T_ref_robot, double gate_m, const PointToLineOptions& options) {
  Linearisation sum;
  const double c = std::cos(T_ref_robot.theta), s = std::sin(T_ref_robot.theta);
  const double scale = std::max(options.residual_sigma_m, 0.25 * gate_m);
  for (const SurfacePoint& point : points_robot) {
    const Eigen::Vector2d turned(c * point.p.x() - s * point.p.y(), s * point.p.x() + c * point.p.y());
    const Eigen::Vector2d p_ref = turned + T_ref_robot.translation();
    const SurfacePoint* nearest = reference.Nearest(p_ref, gate_m);
    if (nearest == nullptr) continue;
    const Eigen::Vector2d offset = p_ref - nearest->p;
    Eigen::Vector2d normal = nearest->normal;
    double trust = 1.0;
    if (nearest->smooth() && point.smooth()) {
      // Two sides of a thin wall are different surfaces.
      const Eigen::Vector2d own(c * point.normal.x() - s * point.normal.y(),
                                s * point.normal.x() + c * point.normal.y());
      if (own.dot(normal) < 0.5) continue;
    } else if (!nearest->smooth()) {
      // A rough reference point only says how far it is.
      const double distance = offset.norm();
      if (distance < 1e-6) continue;
      normal = offset / distance;
      trust = 0.2;
    }
    const double residual = normal.dot(offset);
    const double weight = trust / (1.0 + (residual / scale) * (residual / scale));  // Cauchy.
    const Eigen::Vector3d J(normal.x(), normal.y(), normal.dot(Eigen::Vector2d(-turned.y(), turned.x())));
    sum.H.noalias() += weight * J * J.transpose();
    if (nearest->smooth()) sum.H_surfaces.noalias() += weight * J * J.transpose();
    sum.g.noalias() += weight * residual * J;
    ++sum.pairs;
    if (std::abs(residual) < options.inlier_distance_m) ++sum.inliers;
  }
  return sum;
}

}  // namespace

void Visit(OptionVisitor& visitor, PointToLineOptions& options) {
  visitor.Integer("max_iterations", options.max_iterations, "1", 1, 200, "Hard bound; typical scans stop below 8.");
  visitor.Real("first_pair_distance_m", options.first_pair_distance_m, "m", 0.05, 2.0,
               "Larger tolerates worse guesses and accepts more wrong pairs.");
  visitor.Real("last_pair_distance_m", options.last_pair_distance_m, "m", 0.02, 2.0,
               "The gate shrinks to this over the iterations.");
  visitor.Real("residual_sigma_m", options.residual_sigma_m, "m", 0.001, 1.0,
               "Of a point's distance to its surface; smaller: the scan outweighs odometry more.");
  visitor.Real("effective_points", options.effective_points, "1", 0.001, 100.0,
               "Share of points that count as independent; smaller: more cautious.");
  visitor.Real("stop_step_m", options.stop_step_m, "m", 1e-7, 0.1, "Stops when steps are smaller than both.");
  visitor.Real("stop_step_rad", options.stop_step_rad, "rad", 1e-7, 0.1, "See stop_step_m.");
  visitor.Real("inlier_distance_m", options.inlier_distance_m, "m", 0.01, 1.0,
               "A point nearer to its surface counts as explained.");
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0, "Fewer explained points: not converged.");
  visitor.Real("degenerate_ratio", options.degenerate_ratio, "1", 0.0, 1.0,
               "Weakest over strongest hold on translation below which it is a corridor.");
}

MatchResult AlignPointsToSurfaces(std::span<const SurfacePoint> points_robot, const PointIndex& reference,
                                  const AlignmentGuess& guess, const PointToLineOptions& options) {
  MatchResult result;
  result.T_prev_curr = guess.T_ref_robot_prior;
  result.covariance = guess.prior_covariance;
  if (points_robot.size() < 5 || reference.size() < 5) {
    result.failure = MatchFailure::kTooFewFeatures;
    return result;
  }
  const Eigen::Matrix3d prior_information = guess.prior_covariance.llt().solve(Eigen::Matrix3d::Identity());
  const double per_point = options.effective_points / (options.residual_sigma_m * options.residual_sigma_m);
  Pose2 T = guess.T_ref_robot_start;
  Linearisation sum;
  bool settled = false;
  for (int iteration = 0; iteration < options.max_iterations && !settled; ++iteration) {
    const double shrink = std::min(1.0, iteration / 6.0);
    const double gate =
        options.first_pair_distance_m + shrink * (options.last_pair_distance_m - options.first_pair_distance_m);
    sum = Linearise(points_robot, reference, T, gate, options);
    if (sum.pairs < 5) break;
    Eigen::Vector3d from_prior = T.vector() - guess.T_ref_robot_prior.vector();
    from_prior.z() = WrapAngle(from_prior.z());
    const Eigen::Matrix3d H = per_point * sum.H + prior_information;
    const Eigen::Vector3d step = -H.ldlt().solve(per_point * sum.g + prior_information * from_prior);
    if (!step.allFinite()) {
      result.failure = MatchFailure::kNotConverged;
      return result;
    }
    T = {T.x + step.x(), T.y + step.y(), WrapAngle(T.theta + step.z())};
    result.iterations = iteration + 1;
    settled =
        shrink >= 1.0 && step.head<2>().norm() < options.stop_step_m && std::abs(step.z()) < options.stop_step_rad;
  }
  sum = Linearise(points_robot, reference, T, options.last_pair_distance_m, options);
  result.inliers = sum.inliers;
  result.score = static_cast<double>(sum.inliers) / static_cast<double>(points_robot.size());
  if (result.score < options.min_score || sum.pairs < 5) {
    result.failure = MatchFailure::kNotConverged;
    return result;
  }
  result.T_prev_curr = T;
  result.converged = true;
  result.covariance = (per_point * sum.H + prior_information).llt().solve(Eigen::Matrix3d::Identity());
  result.covariance = 0.5 * (result.covariance + result.covariance.transpose()).eval();
  // A rough point holds in every direction by its nature; only surfaces tell whether the place does.
  JudgeDegeneracy(sum.H_surfaces, options.degenerate_ratio, result);
  return result;
}

}  // namespace cairn::slam
