#include "server/slam/motion/step_motion.h"

#include <cmath>

namespace cairn::slam {

Eigen::Matrix3d MotionNoise::Covariance(const Pose2& T_prev_curr) const {
  const double distance = T_prev_curr.translation().norm();
  const double turn = std::abs(T_prev_curr.theta);
  const double trans = trans_base_m + trans_per_m * distance + trans_per_rad * turn;
  const double rot = rot_base_rad + rot_per_m * distance + rot_per_rad * turn;
  return PoseCovariance(trans, rot);
}

Eigen::Matrix3d OdometryNoise::Covariance(double distance_m, double turn_rad) const {
  const auto variance = [&](double per_sqrt_m, double per_sqrt_rad) {
    return per_sqrt_m * per_sqrt_m * distance_m + per_sqrt_rad * per_sqrt_rad * turn_rad;
  };
  const double trans = variance(trans_m_per_sqrt_m, trans_m_per_sqrt_rad);
  const double rot = variance(rot_rad_per_sqrt_m, rot_rad_per_sqrt_rad);
  return Eigen::Vector3d(trans, trans, rot).asDiagonal();
}

void Visit(OptionVisitor& visitor, OdometryNoise& options) {
  visitor.Real("trans_m_per_sqrt_m", options.trans_m_per_sqrt_m, "m/sqrt(m)", 0.0, 2.0,
               "Standard deviation of x and of y after one metre. It grows with the square root of the distance.");
  visitor.Real("trans_m_per_sqrt_rad", options.trans_m_per_sqrt_rad, "m/sqrt(rad)", 0.0, 2.0,
               "Standard deviation of x and of y after a turn of one radian.");
  visitor.Real("rot_rad_per_sqrt_m", options.rot_rad_per_sqrt_m, "rad/sqrt(m)", 0.0, 2.0,
               "Standard deviation of the heading after one metre.");
  visitor.Real("rot_rad_per_sqrt_rad", options.rot_rad_per_sqrt_rad, "rad/sqrt(rad)", 0.0, 2.0,
               "Standard deviation of the heading after a turn of one radian.");
}

void Visit(OptionVisitor& visitor, MotionNoise& options) {
  visitor.Real("trans_base_m", options.trans_base_m, "m", 0.0, 1.0,
               "Standard deviation of x and of y after a step without motion.");
  visitor.Real("trans_per_m", options.trans_per_m, "m/m", 0.0, 2.0,
               "Standard deviation of x and of y per metre travelled.");
  visitor.Real("trans_per_rad", options.trans_per_rad, "m/rad", 0.0, 2.0,
               "Standard deviation of x and of y per radian turned.");
  visitor.Real("rot_base_rad", options.rot_base_rad, "rad", 0.0, 1.0,
               "Standard deviation of the heading after a step without motion.");
  visitor.Real("rot_per_m", options.rot_per_m, "rad/m", 0.0, 2.0,
               "Standard deviation of the heading per metre travelled.");
  visitor.Real("rot_per_rad", options.rot_per_rad, "rad/rad", 0.0, 2.0,
               "Standard deviation of the heading per radian turned.");
}

}  // namespace cairn::slam
