#include "server/slam/landmarks/landmark_sighting.h"

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

TEST(PointJacobian, IsTheDerivativeByTheMeasurement) {
  const Pose2 T_map_robot{0.4, -1.2, 0.7};
  const Eigen::Vector2d z(2.5, -0.8);
  const auto point = [&](const Eigen::Vector2d& m) -> Eigen::Vector2d {
    return T_map_robot * Eigen::Vector2d(m.x() * std::cos(m.y()), m.x() * std::sin(m.y()));
  };
  EXPECT_LT((J_point_z(T_map_robot, z) - NumericalDerivative<2, 2>(point, z)).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(SlopesAgree, LooksAtBothSidesOfACorner) {
  const LandmarkOptions options;
  const LandmarkSignature right_angle{true, kPi / 2};
  LandmarkSighting sighting{0, right_angle, {2, 0}, 0.3};
  EXPECT_TRUE(SlopesAgree(sighting, 0.2, 0.5, right_angle, options));
  EXPECT_TRUE(SlopesAgree(sighting, 0.2, 0.5 - 2 * kPi, right_angle, options)) << "angles wrap";
  EXPECT_FALSE(SlopesAgree(sighting, 0.2, 0.5 + 1.1 * options.match_slope_rad, right_angle, options));
  // The first side differs by 0.8 of the gate in one direction, the second side by 0.8 in the other.
  sighting.signature.shape -= 0.8 * options.match_slope_rad;
  EXPECT_FALSE(SlopesAgree(sighting, 0.2, 0.5 + 0.8 * options.match_slope_rad, right_angle, options));
}

TEST(Alike, TellsCornersFromLinesAndByTheirShape) {
  const LandmarkOptions options;
  EXPECT_FALSE(Alike({true, 1.0}, {false, 1.0}, options));
  EXPECT_TRUE(Alike({true, kPi - 0.01}, {true, -kPi + 0.01}, options));
  EXPECT_FALSE(Alike({true, 1.5}, {true, -1.5}, options));
  EXPECT_TRUE(Alike({false, 1.0}, {false, 1.2}, options));
  EXPECT_FALSE(Alike({false, 1.0}, {false, 1.3}, options));
}

}  // namespace
}  // namespace cairn::slam
