#include "server/slam/matchers/ndt_evidence.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

// The scan counts as a corridor when the smallest eigenvalue of the information on the translation is below
// this share of the largest.
constexpr double kDegenerateRatio = 0.03;
// Least standard deviation along a corridor. Measured on duke-loop5: 0.045 m a scan.
constexpr double kOpenSigmaM = 0.05;

// Finds the direction in which the scan determines the translation least, if the heading is free to follow.
// If that direction is open, its apparent information comes mostly from cell boundaries and sampling, and is
// limited to that of a standard deviation of kOpenSigmaM.
void DetectDegeneracy(Eigen::Matrix3d& information, MatchResult& result) {
  const Eigen::Matrix2d translation = information.topLeftCorner<2, 2>() - information.topRightCorner<2, 1>() *
                                                                              information.bottomLeftCorner<1, 2>() /
                                                                              std::max(information(2, 2), 1e-12);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(translation);
  result.degenerate = !(solver.eigenvalues()(0) >= kDegenerateRatio * solver.eigenvalues()(1));
  if (!result.degenerate) return;
  const Eigen::Vector2d open = solver.eigenvectors().col(0);
  result.degenerate_direction = open;
  const double excess = solver.eigenvalues()(0) - 1.0 / (kOpenSigmaM * kOpenSigmaM);
  if (excess > 0.0) information.topLeftCorner<2, 2>() -= excess * open * open.transpose();
}

}  // namespace

void Visit(OptionVisitor& visitor, NdtEvidenceOptions& options) {
  visitor.Real("min_score", options.min_score, "1", 0.0, 1.0,
               "Share of the points that must be explained. With fewer there is no match.");
  visitor.Integer("min_inliers", options.min_inliers, "1", 1, 8192,
                  "Number of points that must be explained. With fewer there is no match.");
  visitor.Real("information_share", options.information_share, "1", 1e-6, 1.0,
               "Share of the Hessian that counts as information. A smaller value gives larger covariances.");
}

Eigen::Matrix3d InformationOf(const NdtDerivatives& at_pose, const NdtEvidenceOptions& options) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(-options.information_share * at_pose.hessian);
  const Eigen::Matrix3d& V = solver.eigenvectors();
  const Eigen::Matrix3d information = V * solver.eigenvalues().cwiseMax(0.0).asDiagonal() * V.transpose();
  return 0.5 * (information + information.transpose());
}

MatchResult UnmatchedNdt(const MatchPrior& prior, MatchFailure failure) {
  MatchResult result;
  result.T_ref_curr = prior.T_ref_curr;
  result.covariance = prior.covariance;
  result.failure = failure;
  return result;
}

MatchResult EvaluateNdtPose(const NdtMap& map, std::span<const Eigen::Vector2d> points_curr, const Pose2& T_ref_curr,
                            bool settled, const MatchPrior& prior, const NdtEvidenceOptions& options) {
  MatchResult result = UnmatchedNdt(prior, MatchFailure::kNotConverged);
  const NdtDerivatives at_pose = map.Derivatives(points_curr, T_ref_curr);
  result.inliers = at_pose.inliers;
  result.score =
      static_cast<double>(at_pose.inliers) / static_cast<double>(std::max<std::size_t>(points_curr.size(), 1));
  Eigen::Matrix3d information = InformationOf(at_pose, options);
  if (!settled || result.score < options.min_score || result.inliers < options.min_inliers || !information.allFinite())
    return result;

  DetectDegeneracy(information, result);
  const Eigen::LLT<Eigen::Matrix3d> prior_factor(prior.covariance);
  if (prior_factor.info() != Eigen::Success) return result;
  const Eigen::Matrix3d prior_information = prior_factor.solve(Eigen::Matrix3d::Identity());
  const Eigen::LLT<Eigen::Matrix3d> joint(information + prior_information);
  const Eigen::Vector3d to_prior = Minus(prior.T_ref_curr, T_ref_curr);
  const Eigen::Vector3d step = joint.solve(prior_information * to_prior);
  const Eigen::Matrix3d covariance = joint.solve(Eigen::Matrix3d::Identity());
  if (joint.info() != Eigen::Success || !step.allFinite() || !covariance.allFinite()) return result;
  result.T_ref_curr = Plus(T_ref_curr, step);
  result.covariance = 0.5 * (covariance + covariance.transpose());
  result.converged = true;
  result.failure = MatchFailure::kNone;
  return result;
}

}  // namespace cairn::slam
