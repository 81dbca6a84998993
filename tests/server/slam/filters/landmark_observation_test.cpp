#include "server/slam/filters/landmark_observation.h"

#include <gtest/gtest.h>

#include "tests/numerical_derivative.h"

namespace cairn::slam {
namespace {

TEST(PredictRangeBearing, JacobiansAreTheDerivatives) {
  const Eigen::Vector3d pose(0.4, -1.2, 0.7);
  const Eigen::Vector2d point(3.1, 2.2);
  const RangeBearing predicted = PredictRangeBearing({pose.x(), pose.y(), pose.z()}, point);
  const auto by_pose = NumericalDerivative<2, 3>(
      [&](const Eigen::Vector3d& x) {
        return PredictRangeBearing({x.x(), x.y(), x.z()}, point).z;
      },
      pose);
  const auto by_point = NumericalDerivative<2, 2>(
      [&](const Eigen::Vector2d& p) {
        return PredictRangeBearing({pose.x(), pose.y(), pose.z()}, p).z;
      },
      point);
  EXPECT_LT((predicted.J_z_pose - by_pose).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((predicted.J_z_point - by_point).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(PredictRangeBearing, AgreesWithTheMeasurementOfAPointInTheRobotFrame) {
  const Pose2 T_map_robot{2.0, 1.0, 2.9};
  const Eigen::Vector2d p_robot(-1.5, 0.3);
  const Eigen::Vector2d predicted = PredictRangeBearing(T_map_robot, T_map_robot * p_robot).z;
  const Eigen::Vector2d measured = MeasureRangeBearing(p_robot);
  EXPECT_NEAR(predicted.x(), measured.x(), 1e-12);
  EXPECT_NEAR(AngleDiff(predicted.y(), measured.y()), 0.0, 1e-12);
}

TEST(PredictRangeBearing, StaysFiniteOnTopOfTheLandmark) {
  EXPECT_TRUE(PredictRangeBearing({1, 1, 0}, {1, 1}).J_z_pose.allFinite());
}

}  // namespace
}  // namespace cairn::slam
