#include "server/slam/matching/ndt_evidence.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

namespace cairn::slam {
namespace {

// Finds the direction in which the scan holds the translation least, with the heading free to follow. Where it is open,
// what the cells seem to know about it comes mostly of their cuts and sampling, and counts for no more than
// open_sigma_m.
void JudgeDegeneracy(const NdtEvidenceOptions& options, Eigen::Matrix3d& information, MatchResult& result) {
  const Eigen::Matrix2d translation = information.topLeftCorner<2, 2>() - information.topRightCorner<2, 1>() *
                                                                              information.bottomLeftCorner<1, 2>() /
                                                                              std::max(information(2, 2), 1e-12);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(translation);
  result.degenerate = !(solver.eigenvalues()(0) >= options.degenerate_ratio * solver.eigenvalues()(1));
  if (!result.degenerate) return;
  const Eigen::Vector2d open = solver.eigenvectors().col(0);
  result.degenerate_direction = open;
  const double excess = solver.eigenvalues()(0) - 1.0 / (options.open_sigma_m * options.open_sigma_m);
  if (excess > 0.0) information.topLeftCorner<2, 2>() -= excess * open * open.transpose();
}

}  // namespace

void Visit(OptionVisitor& visitor, NdtEvidenceOptions& options) {
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0, "Fewer explained points: not converged.");
  visitor.Integer("min_inliers", options.min_inliers, "1", 1, 8192, "Nor with fewer explained points than this.");
  visitor.Real("information_share", options.information_share, "1", 1e-6, 1.0,
               "Of the Hessian that counts as information; smaller: more cautious.");
  visitor.Real("degenerate_ratio", options.degenerate_ratio, "1", 0.0, 1.0,
               "Weakest over strongest hold on translation below which it is a corridor.");
  visitor.Real("open_sigma_m", options.open_sigma_m, "m", 1e-3, 1e3,
               "Along the direction a corridor leaves open; larger: the prior decides more.");
}

Eigen::Matrix3d InformationOf(const NdtDerivatives& at_pose, const NdtEvidenceOptions& options) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(-options.information_share * at_pose.hessian);
  const Eigen::Matrix3d& V = solver.eigenvectors();
  const Eigen::Matrix3d information = V * solver.eigenvalues().cwiseMax(0.0).asDiagonal() * V.transpose();
  return 0.5 * (information + information.transpose());
}

MatchResult UnmatchedNdt(const MatchPrior& prior, MatchFailure failure) {
  MatchResult result;
  result.T_prev_curr = prior.T_prev_curr;
  result.covariance = prior.covariance;
  result.failure = failure;
  return result;
}

MatchResult JudgeNdtPose(const NdtMap& map, std::span<const Eigen::Vector2d> points_curr, const Pose2& T_prev_curr,
                         bool settled, const MatchPrior& prior, const NdtEvidenceOptions& options) {
  MatchResult result = UnmatchedNdt(prior, MatchFailure::kNotConverged);
  const NdtDerivatives at_pose = map.Derivatives(points_curr, T_prev_curr);
  result.inliers = at_pose.inliers;
  result.score =
      static_cast<double>(at_pose.inliers) / static_cast<double>(std::max<std::size_t>(points_curr.size(), 1));
  Eigen::Matrix3d information = InformationOf(at_pose, options);
  if (!settled || result.score < options.min_score || result.inliers < options.min_inliers || !information.allFinite())
    return result;

  JudgeDegeneracy(options, information, result);
  const Eigen::LLT<Eigen::Matrix3d> prior_factor(prior.covariance);
  if (prior_factor.info() != Eigen::Success) return result;
  const Eigen::Matrix3d prior_information = prior_factor.solve(Eigen::Matrix3d::Identity());
  const Eigen::LLT<Eigen::Matrix3d> joint(information + prior_information);
  Eigen::Vector3d to_prior = prior.T_prev_curr.vector() - T_prev_curr.vector();
  to_prior.z() = WrapAngle(to_prior.z());
  const Eigen::Vector3d step = joint.solve(prior_information * to_prior);
  const Eigen::Matrix3d covariance = joint.solve(Eigen::Matrix3d::Identity());
  if (joint.info() != Eigen::Success || !step.allFinite() || !covariance.allFinite()) return result;
  result.T_prev_curr = {T_prev_curr.x + step.x(), T_prev_curr.y + step.y(), WrapAngle(T_prev_curr.theta + step.z())};
  result.covariance = 0.5 * (covariance + covariance.transpose());
  result.converged = true;
  result.failure = MatchFailure::kNone;
  return result;
}

}  // namespace cairn::slam
