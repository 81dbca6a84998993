#include "server/slam/matching/match_result.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace cairn::slam {

void DetectDegeneracy(const Eigen::Matrix3d& H, MatchResult& result) {
  // A room is far above this ratio and a corridor far below: half or twice the value changes nothing (study
  // `sensitivity`).
  constexpr double kCorridorRatio = 0.02;
  // Error of the direction of a surface point. It alone makes a bare wall seem to show a position along it.
  constexpr double kDirectionSigmaRad = 0.05;
  const Eigen::Matrix2d H_translation =
      H.topLeftCorner<2, 2>() - H.topRightCorner<2, 1>() * H.bottomLeftCorner<1, 2>() / std::max(H(2, 2), 1e-12);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(H_translation);
  const double least = solver.eigenvalues()(0), largest = solver.eigenvalues()(1);
  result.degenerate = least < kCorridorRatio * largest;
  result.open_information = 0.0;
  if (!result.degenerate) return;
  result.degenerate_direction = solver.eigenvectors().col(0);
  const double shown = std::max(0.0, least - kDirectionSigmaRad * kDirectionSigmaRad * largest);
  // Towards the bound it grows, so that nothing jumps where the direction is no longer open and the match decides
  // alone.
  result.open_information = shown / std::max(1e-6, 1.0 - least / (kCorridorRatio * largest));
}

Eigen::Vector2d TakeAlongFromPrior(const Eigen::Vector2d& measured, const Eigen::Vector2d& prior,
                                   const Eigen::Vector2d& along) {
  return measured + along.dot(prior - measured) * along;
}

void TakeAlongFromPrior(const MatchPrior& prior, MatchResult& result) {
  if (!result.degenerate) return;
  const Eigen::Vector2d u = result.degenerate_direction;
  const Eigen::Vector2d t = TakeAlongFromPrior(result.T_ref_curr.translation(), prior.T_ref_curr.translation(), u);
  result.T_ref_curr = {t.x(), t.y(), result.T_ref_curr.theta};
  Eigen::Matrix3d across = Eigen::Matrix3d::Identity();
  across.topLeftCorner<2, 2>() -= u * u.transpose();
  result.covariance = across * result.covariance * across.transpose();
  result.covariance.topLeftCorner<2, 2>() += u.dot(prior.covariance.topLeftCorner<2, 2>() * u) * u * u.transpose();
  result.open_information = 0.0;
}

void WeighAlongWithPrior(const MatchPrior& prior, MatchResult& result) {
  if (!result.degenerate) return;
  const Eigen::Vector2d u = result.degenerate_direction;
  const double variance = u.dot(prior.covariance.topLeftCorner<2, 2>() * u), information = result.open_information;
  const double from_prior = 1.0 - GainAlong(variance, information);
  const Eigen::Vector2d measured = result.T_ref_curr.translation();
  const Eigen::Vector2d t = measured + from_prior * (prior.T_ref_curr.translation() - measured);
  MatchPrior weighed = prior;
  weighed.T_ref_curr.x = t.x();
  weighed.T_ref_curr.y = t.y();
  weighed.covariance.topLeftCorner<2, 2>() = from_prior * variance * Eigen::Matrix2d::Identity();
  TakeAlongFromPrior(weighed, result);
  result.open_information = information;
}

}  // namespace cairn::slam
