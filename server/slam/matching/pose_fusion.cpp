#include "server/slam/matching/pose_fusion.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

Eigen::Vector3d From(const PoseBelief& belief, const LineMatchHypothesis& hypothesis) {
  Eigen::Vector3d away = hypothesis.T_map_robot.vector() - belief.T_map_robot.vector();
  away.z() = WrapAngle(away.z());
  return away;
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
  // (2.18) with P (P + S)^-1 for the sum of inverses: the same, and good with an infinite P.
  const Eigen::Matrix3d& P = belief.covariance;
  const Eigen::Matrix3d K = (P + hypothesis.covariance).ldlt().solve(P).transpose();
  const Eigen::Vector3d step = K * From(belief, hypothesis);
  const Eigen::Matrix3d left = Eigen::Matrix3d::Identity() - K;
  // Joseph's form stays positive where P is huge.
  PoseBelief fused{{belief.T_map_robot.x + step.x(), belief.T_map_robot.y + step.y(),
                    WrapAngle(belief.T_map_robot.theta + step.z())},
                   left * P * left.transpose() + K * hypothesis.covariance * K.transpose()};
  fused.covariance = 0.5 * (fused.covariance + fused.covariance.transpose()).eval();
  return fused;
}

}  // namespace cairn::slam
