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

PoseBelief Predict(const PoseBelief& belief, double distance_m, double turn_rad, const Eigen::Matrix2d& covariance) {
  const Pose2& T = belief.T_map_robot;
  const double c = std::cos(T.theta), s = std::sin(T.theta);
  Eigen::Matrix3d J_pose_pose = Eigen::Matrix3d::Identity();
  J_pose_pose(0, 2) = -distance_m * s;
  J_pose_pose(1, 2) = distance_m * c;
  Eigen::Matrix<double, 3, 2> J_pose_motion;
  J_pose_motion << c, 0, s, 0, 0, 1;
  PoseBelief moved{{T.x + distance_m * c, T.y + distance_m * s, WrapAngle(T.theta + turn_rad)},
                   J_pose_pose * belief.covariance * J_pose_pose.transpose() +
                       J_pose_motion * covariance * J_pose_motion.transpose()};
  moved.covariance = 0.5 * (moved.covariance + moved.covariance.transpose()).eval();
  return moved;
}

double DistanceOf(const PoseBelief& belief, const LineMatchHypothesis& hypothesis) {
  const Eigen::Vector3d away = From(belief, hypothesis);
  return away.dot((belief.covariance + hypothesis.covariance).ldlt().solve(away));
}

std::optional<LineMatchHypothesis> Nearest(const PoseBelief& belief, std::span<const LineMatchHypothesis> hypotheses,
                                           double gate) {
  std::optional<LineMatchHypothesis> nearest;
  double best = gate;
  for (const LineMatchHypothesis& hypothesis : hypotheses) {
    const double distance = DistanceOf(belief, hypothesis);
    if (distance >= best) continue;
    best = distance;
    nearest = hypothesis;
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
