#include "server/slam/matchers/hough.h"

#include <gtest/gtest.h>

#include "server/slam/features/feature_extraction.h"
#include "server/slam/matchers/hough_transform.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

ScanView See(const Pose2& pose, const test::Laser& laser = test::FullTurnLaser(720)) {
  const Scan scan = test::Look(test::Office(), pose, laser);
  return {{}, SurfacePointsOf(PointsOf(scan), scan, SurfaceOptions{})};
}

TEST(HoughTransform, AWallIsOnePeak) {
  std::vector<SurfacePoint> points;
  const Eigen::Vector2d n(std::cos(Radians(30)), std::sin(Radians(30))), u(-n.y(), n.x());
  for (int i = -20; i <= 20; ++i) points.push_back({2.0 * n + 0.05 * i * u, -n});
  const HoughTransform transform(points, 180, 0.1, 10.0);
  const int wall = transform.half() + 20;
  EXPECT_NEAR(transform.At(30, wall), 41.0, 1e-3);
  EXPECT_NEAR(transform.At(30 + 180, transform.half() - 20), 41.0, 1e-3);  // (theta + pi, -rho) is the same line.
  EXPECT_NEAR(transform.At(30 - 360, wall), 41.0, 1e-3);
  const auto peaks = PeaksOf(transform.spectrum(), true, 1, 0.1);
  ASSERT_EQ(peaks.size(), 1U);
  EXPECT_NEAR(peaks[0].place, 30.0, 0.3);
}

TEST(HoughTransform, TurningTheRobotShiftsTheSpectrumAndMovingItDoesNot) {
  const ScanView prev = See({0, 0.3, 0}), curr = See({0.15, 0.2, Radians(25)});
  const HoughTransform a(prev.points_robot, 180, 0.05, 20.0), b(curr.points_robot, 180, 0.05, 20.0);
  const auto peaks = PeaksOf(CorrelateSpectra(a, b), true, 1, 0.1);
  ASSERT_EQ(peaks.size(), 1U);
  EXPECT_NEAR(peaks[0].place, 25.0, 1.0);
}

TEST(HoughTransform, PeaksAreFoundBetweenBins) {
  std::vector<double> values(20, 0.0);
  for (int i = 0; i < 20; ++i) values[static_cast<std::size_t>(i)] = 10.0 - (i - 7.3) * (i - 7.3);
  const auto peaks = PeaksOf(values, false, 5, 0.1);
  ASSERT_EQ(peaks.size(), 1U);
  EXPECT_NEAR(peaks[0].place, 7.3, 1e-9);
}

TEST(Hough, FindsAnyTurnWithoutAGuess) {
  const Pose2 start{-0.3, 0.4, 0.1};
  const ScanView prev = See(start);
  const MatchPrior nothing{{}, Eigen::Vector3d(1.0, 1.0, 100.0).asDiagonal()};
  for (int k = -5; k <= 6; ++k) {
    const Pose2 motion{0.3, -0.25, Radians(30.0 * k + 4.0)};
    const MatchResult match = MatchByHough(prev, See(start * motion), nothing, {}, SerialFor);
    ASSERT_TRUE(match.converged) << 30 * k + 4;
    EXPECT_LT((match.T_ref_curr.translation() - motion.translation()).norm(), 0.06) << 30 * k + 4;
    EXPECT_LT(std::abs(AngleDiff(match.T_ref_curr.theta, motion.theta)), Radians(1.0)) << 30 * k + 4;
  }
}

TEST(Hough, NoAnswerLiesOutsideTheWindowOfTurns) {
  const Pose2 start{-0.3, 0.4, 0.1};
  HoughOptions options;
  options.max_rotation_rad = Radians(30);
  const ScanView prev = See(start), curr = See(start * Pose2{0, 0, Radians(90)});
  const MatchResult without = MatchByHough(prev, curr, {}, {}, SerialFor);
  EXPECT_NEAR(std::abs(without.T_ref_curr.theta), Radians(90), Radians(2)) << "the window must be what keeps it out";
  const MatchResult match = MatchByHough(prev, curr, {}, options, SerialFor);
  EXPECT_LE(std::abs(match.T_ref_curr.theta), Radians(31));
}

}  // namespace
}  // namespace cairn::slam
