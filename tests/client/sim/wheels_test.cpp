#include "client/sim/wheels.h"

#include <gtest/gtest.h>

#include <cmath>

#include "client/sim/arc.h"

namespace cairn::sim {
namespace {

WheelOptions PerfectWheels() {
  WheelOptions options;
  options.slip_m_per_sqrt_m = 0.0;
  return options;
}

void ExpectPose(const Pose2& got, const Pose2& expected, double tolerance) {
  EXPECT_NEAR(got.x, expected.x, tolerance);
  EXPECT_NEAR(got.y, expected.y, tolerance);
  EXPECT_NEAR(std::abs(AngleDiff(got.theta, expected.theta)), 0.0, tolerance);
}

TEST(DriveArc, AHalfCircleEndsBesideItsStart) {
  ExpectPose(DriveArc(kPi * 2.0, kPi), {0, 4, kPi}, 1e-12);
  ExpectPose(DriveArc(3.0, 0.0), {3, 0, 0}, 1e-12);
  ExpectPose(DriveArc(1.0, 1e-6), DriveArc(1.0, 2.1e-6), 1.2e-6);
}

TEST(Wheels, PerfectWheelsTellTheTruth) {
  Random random(1);
  WheelOdometry odometry(PerfectWheels());
  Pose2 truth;
  for (int i = 0; i < 1000; ++i) {
    const double way = 0.01, turn = 0.004 * std::sin(i * 0.01);
    odometry.Drive(way, turn, random);
    truth = truth * DriveArc(way, turn);
  }
  ExpectPose(odometry.T_odom_robot(), truth, 1e-9);
}

TEST(Wheels, ALargerRightWheelReadsALeftTurn) {
  Random random(1);
  WheelOptions options = PerfectWheels();
  options.right_share = 0.01;
  WheelOdometry odometry(options);
  for (int i = 0; i < 1000; ++i) odometry.Drive(0.01, 0.0, random);
  EXPECT_NEAR(odometry.T_odom_robot().theta, 10.0 * 0.01 / options.base_m, 1e-9);
}

TEST(Wheels, AWiderBelievedBaseReadsSmallerTurns) {
  Random random(1);
  WheelOptions options = PerfectWheels();
  options.base_share = 0.25;
  WheelOdometry odometry(options);
  for (int i = 0; i < 100; ++i) odometry.Drive(0.0, 0.02, random);
  EXPECT_NEAR(odometry.T_odom_robot().theta, 2.0 / 1.25, 1e-9);
}

TEST(Wheels, SlipHasItsVarianceHoweverFineTheSteps) {
  WheelOptions options = PerfectWheels();
  options.slip_m_per_sqrt_m = 0.01;
  const double way = 4.0;
  // Each wheel: variance k^2 * way. The robot's way is their mean, its turn their difference over the base.
  const double sigma_way = 0.01 * std::sqrt(way / 2), sigma_turn = 0.01 * std::sqrt(2 * way) / options.base_m;
  for (const int steps : {4, 100}) {
    Random random(11);
    double way_squares = 0, turn_squares = 0, turn_sum = 0;
    const int n = 3000;
    for (int k = 0; k < n; ++k) {
      WheelOdometry odometry(options);
      double last_theta = 0, length = 0;
      Pose2 last;
      for (int i = 0; i < steps; ++i) {
        odometry.Drive(way / steps, 0.0, random);
        length += Between(last, odometry.T_odom_robot()).translation().norm();
        last = odometry.T_odom_robot();
        last_theta = last.theta;
      }
      way_squares += (length - way) * (length - way);
      turn_squares += last_theta * last_theta;
      turn_sum += last_theta;
    }
    EXPECT_NEAR(std::sqrt(way_squares / n), sigma_way, 0.06 * sigma_way) << steps;
    EXPECT_NEAR(std::sqrt(turn_squares / n), sigma_turn, 0.06 * sigma_turn) << steps;
    EXPECT_NEAR(turn_sum / n, 0.0, 4 * sigma_turn / std::sqrt(n)) << steps;
  }
}

TEST(Wheels, RobotsOfOneMakeDifferByTheSpread) {
  Random random(5);
  const WheelSpread spread{0.01, 0.03};
  double left = 0, right = 0, base = 0;
  const int n = 4000;
  for (int i = 0; i < n; ++i) {
    const WheelOptions drawn = DrawWheels(PerfectWheels(), spread, random);
    left += drawn.left_share * drawn.left_share;
    right += drawn.right_share * drawn.right_share;
    base += drawn.base_share * drawn.base_share;
  }
  EXPECT_NEAR(std::sqrt(left / n), 0.01, 0.0005);
  EXPECT_NEAR(std::sqrt(right / n), 0.01, 0.0005);
  EXPECT_NEAR(std::sqrt(base / n), 0.03, 0.0015);
}

TEST(Wheels, RefusesImpossibleOptions) {
  EXPECT_TRUE(Validate(WheelOptions{}));
  WheelOptions options;
  options.base_m = 0;
  EXPECT_FALSE(Validate(options));
  options = {};
  options.left_share = std::nan("");
  EXPECT_FALSE(Validate(options));
  options = {};
  options.slip_m_per_sqrt_m = -1;
  EXPECT_FALSE(Validate(options));
}

}  // namespace
}  // namespace cairn::sim
