#include "server/slam/localisation/pose_fusion.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

Eigen::Vector3d From(const PoseBelief& belief, const LineMatchHypothesis& hypothesis) {
  return Minus(hypothesis.T_map_robot, belief.T_map_robot);
}

}  // namespace

PoseBelief PoseBelief::Unknown() {
  return {{}, Eigen::Vector3d(1e8, 1e8, 1e4).asDiagonal()};
}

double DistanceOf(const PoseBelief& belief, const LineMatchHypothesis& hypothesis) {
  const Eigen::Vector3d away = From(belief, hypothesis);
  return away.dot((belief.covariance + hypothesis.covariance).ldlt().solve(away));
}

std::optional<std::size_t> Nearest(const PoseBelief& belief, std::span<const LineMatchHypothesis> hypotheses,
                                   double gate) {
  std::optional<std::size_t> nearest;
  double best = gate;
  for (std::size_t h = 0; h < hypotheses.size(); ++h) {
    const double distance = DistanceOf(belief, hypotheses[h]);
    if (distance >= best) continue;
    best = distance;
    nearest = h;
  }
  return nearest;
}

PoseBelief Fuse(const PoseBelief& belief, const LineMatchHypothesis& hypothesis) {
  // (2.18) with P (P + S)^-1 instead of the sum of inverses: equivalent, and stable for a huge P.
  const Eigen::Matrix3d& P = belief.covariance;
  const Eigen::Matrix3d K = (P + hypothesis.covariance).ldlt().solve(P).transpose();
  const Eigen::Matrix3d left = Eigen::Matrix3d::Identity() - K;
  // Joseph's form stays positive definite for a huge P.
  PoseBelief fused{Plus(belief.T_map_robot, K * From(belief, hypothesis)),
                   left * P * left.transpose() + K * hypothesis.covariance * K.transpose()};
  fused.covariance = 0.5 * (fused.covariance + fused.covariance.transpose()).eval();
  return fused;
}

}  // namespace cairn::slam
