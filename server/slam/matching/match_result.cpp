#include "server/slam/matching/match_result.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace cairn::slam {

void DetectDegeneracy(const Eigen::Matrix3d& H, MatchResult& result) {
  // A room is far above this ratio and a corridor far below: half or twice the value changes nothing (study
  // `sensitivity`).
  constexpr double kCorridorRatio = 0.02;
  const Eigen::Matrix2d H_translation =
      H.topLeftCorner<2, 2>() - H.topRightCorner<2, 1>() * H.bottomLeftCorner<1, 2>() / std::max(H(2, 2), 1e-12);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(H_translation);
  result.degenerate = solver.eigenvalues()(0) < kCorridorRatio * solver.eigenvalues()(1);
  if (result.degenerate) result.degenerate_direction = solver.eigenvectors().col(0);
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
}

}  // namespace cairn::slam
