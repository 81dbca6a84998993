#include "server/slam/ekf/joint_state.h"

#include <algorithm>
#include <cmath>

#include "server/slam/motion/odometry_model.h"

namespace cairn::slam {

JointState::JointState(const Pose2& T_map_robot_start)
    : mean_(T_map_robot_start.vector()), covariance_(Eigen::Matrix3d::Zero()) {}

void JointState::Turn(Eigen::Index at, double angle_rad) {
  const Eigen::Matrix2d R = Eigen::Rotation2Dd(angle_rad).toRotationMatrix();
  const Eigen::Matrix2Xd rows = R * covariance_.block(at, 0, 2, size_);
  covariance_.block(at, 0, 2, size_) = rows;
  const Eigen::MatrixX2d columns = covariance_.block(0, at, size_, 2) * R.transpose();
  covariance_.block(0, at, size_, 2) = columns;
}

void JointState::Move(const Pose2& T_prev_curr, const Eigen::Matrix3d& step_covariance_prev) {
  const OdometryControl control = InverseOdometry(T_prev_curr);
  const Pose2 before = robot();
  const Eigen::Matrix3d F = J_pose_pose(before, control);
  const Eigen::Matrix3d J_step = J_compose_right(before, T_prev_curr);
  const Eigen::Matrix3d P =
      F * covariance<3, 3>(0, 0) * F.transpose() + J_step * step_covariance_prev * J_step.transpose();
  const Eigen::Index rest = size_ - 3;
  const Eigen::MatrixXd cross = F * covariance_.block(0, 3, 3, rest);
  covariance_.block(0, 3, 3, rest) = cross;
  covariance_.block(3, 0, rest, 3) = cross.transpose();
  covariance_.topLeftCorner<3, 3>() = 0.5 * (P + P.transpose());
  mean_.head<3>() = ApplyControl(before, control).vector();
}

Eigen::Index JointState::AddPoint(const Eigen::Vector2d& z, const Eigen::Matrix2d& R_z) {
  const Eigen::Index at = size_;
  Grow(2);
  const Pose2 pose = robot();
  const double course = pose.theta + z.y(), s = std::sin(course), c = std::cos(course);
  Eigen::Matrix<double, 2, 3> J_robot;
  J_robot << 1, 0, -z.x() * s, 0, 1, z.x() * c;
  Eigen::Matrix2d J_z;
  J_z << c, -z.x() * s, s, z.x() * c;
  mean_.segment<2>(at) = pose.translation() + z.x() * Eigen::Vector2d(c, s);
  const Eigen::MatrixXd cross = J_robot * covariance_.block(0, 0, 3, at);
  covariance_.block(at, 0, 2, at) = cross;
  covariance_.block(0, at, at, 2) = cross.transpose();
  covariance_.block<2, 2>(at, at) =
      J_robot * covariance<3, 3>(0, 0) * J_robot.transpose() + J_z * R_z * J_z.transpose();
  return at;
}

Eigen::Index JointState::AddRobotPose() {
  const Eigen::Index at = size_;
  Grow(3);
  mean_.segment<3>(at) = mean_.head<3>();
  covariance_.block(at, 0, 3, at) = covariance_.block(0, 0, 3, at);
  covariance_.block(0, at, at, 3) = covariance_.block(0, 0, at, 3);
  covariance_.block<3, 3>(at, at) = covariance_.topLeftCorner<3, 3>();
  headings_.push_back(at + 2);
  return at;
}

void JointState::Remove(Eigen::Index at, Eigen::Index count) {
  const Eigen::Index behind = size_ - at - count;
  mean_.segment(at, behind) = mean_.segment(at + count, behind).eval();
  covariance_.block(0, at, size_, behind) = covariance_.block(0, at + count, size_, behind).eval();
  covariance_.block(at, 0, behind, size_) = covariance_.block(at + count, 0, behind, size_).eval();
  size_ -= count;
  std::erase_if(headings_, [&](Eigen::Index h) { return h >= at && h < at + count; });
  for (Eigen::Index& h : headings_)
    if (h >= at) h -= count;
}

void JointState::Grow(Eigen::Index count) {
  if (size_ + count > mean_.size()) {
    const Eigen::Index capacity = std::max(2 * mean_.size(), size_ + count);
    mean_.conservativeResize(capacity);
    covariance_.conservativeResize(capacity, capacity);
  }
  size_ += count;
}

void JointState::Learn(const Eigen::MatrixXd& PHt, const Eigen::MatrixXd& S, const Eigen::VectorXd& v) {
  const Eigen::LLT<Eigen::MatrixXd> factor(S);
  // With S = L L' and W = P H' L^-T, K S K' = W W', which keeps the covariance symmetric.
  const Eigen::MatrixXd W = factor.matrixL().solve(PHt.transpose()).transpose();
  mean_.head(size_) += W * factor.matrixL().solve(v);
  covariance_.topLeftCorner(size_, size_).noalias() -= W * W.transpose();
  for (const Eigen::Index h : headings_) mean_(h) = WrapAngle(mean_(h));
}

}  // namespace cairn::slam
