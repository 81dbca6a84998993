#include "server/slam/motion/odometry_model.h"

#include <gtest/gtest.h>

#include "tests/numerical_derivative.h"

namespace cairn::slam {
namespace {

Eigen::Vector3d Applied(const Eigen::Vector3d& pose, const Eigen::Vector3d& control) {
  return ApplyControl({pose.x(), pose.y(), pose.z()}, {control.x(), control.y(), control.z()}).vector();
}

TEST(InverseOdometry, UndoesApplyControlInEveryDirectionOfTravel) {
  const Pose2 start{1.0, -2.0, 0.8};
  for (double course = -3.0; course < 3.1; course += 0.4) {
    const Pose2 step{0.5 * std::cos(course), 0.5 * std::sin(course), 0.3};
    const Pose2 end = ApplyControl(start, InverseOdometry(step)), expected = start * step;
    EXPECT_NEAR(end.x, expected.x, 1e-12);
    EXPECT_NEAR(end.y, expected.y, 1e-12);
    EXPECT_NEAR(AngleDiff(end.theta, expected.theta), 0.0, 1e-12);
  }
}

TEST(InverseOdometry, DrivingBackwardsIsNoTurnAbout) {
  const OdometryControl control = InverseOdometry({-0.5, 0.0, 0.0});
  EXPECT_DOUBLE_EQ(control.trans, -0.5);
  EXPECT_DOUBLE_EQ(control.rot1, 0.0);
}

TEST(InverseOdometry, TurningOnTheSpotIsASecondRotation) {
  const OdometryControl control = InverseOdometry({0.0, 0.0, 1.0});
  EXPECT_DOUBLE_EQ(control.rot1, 0.0);
  EXPECT_DOUBLE_EQ(control.rot2, 1.0);
}

TEST(OdometryModel, TheJacobianIsTheDerivative) {
  const Eigen::Vector3d pose(0.3, 0.2, 0.5), control(0.2, 0.7, -0.1);
  const Pose2 at{pose.x(), pose.y(), pose.z()};
  const OdometryControl u{control.x(), control.y(), control.z()};
  const auto Gv = NumericalDerivative<3, 3>([&](const Eigen::Vector3d& x) { return Applied(x, control); }, pose);
  EXPECT_LT((J_pose_pose(at, u) - Gv).cwiseAbs().maxCoeff(), 1e-6);
}

}  // namespace
}  // namespace cairn::slam
