#include "server/slam/matchers/ndt_de.h"

#include <gtest/gtest.h>

#include <thread>

#include "server/slam/features/scan_view.h"
#include "tests/server/slam/matchers/ndt_worlds.h"

namespace cairn::slam {
namespace {

using test::OffsetOf;
using test::TurnOf;
using test::ViewFrom;
using test::WidePrior;

void ThreeThreads(int count, const std::function<void(int, int)>& body) {
  std::thread last([&] { body(2 * count / 3, count); });
  std::thread middle([&] { body(count / 3, 2 * count / 3); });
  body(0, count / 3);
  middle.join();
  last.join();
}

// Starts anywhere in the range of Table 4.4, without a guess.
MatchResult MatchNdtDe(const ScanView& prev, const ScanView& curr, const MatchPrior& prior) {
  return MatchByDifferentialEvolution(prev, curr, prior, {}, SerialFor);
}

TEST(NdtDe, FindsTheMotionWithoutAGuess) {
  const ScanView prev = ViewFrom(test::Office(), {});
  for (const Pose2& truth :
       {Pose2{}, Pose2{0.9, 0.1, 0.0}, Pose2{-0.4, -0.2, 0.1}, Pose2{0.6, -0.2, -Radians(18)}, Pose2{0.2, 0.2, 0.3}}) {
    const MatchResult match =
        MatchByDifferentialEvolution(prev, ViewFrom(test::Office(), truth), WidePrior(), {}, SerialFor);
    ASSERT_TRUE(match.converged) << truth.x << ' ' << truth.theta;
    EXPECT_LT(OffsetOf(match, truth), 0.015);
    EXPECT_LT(TurnOf(match, truth), 0.004);
    EXPECT_TRUE(IsCovariance(match.covariance));
    EXPECT_FALSE(match.degenerate);
  }
}

// The method of the thesis, without the climb: its 50 generations come near the answer but do not reach it.
TEST(NdtDe, TheEvolutionAloneComesWithinCentimetres) {
  NdtDeOptions options;
  options.climb = false;
  const ScanView prev = ViewFrom(test::Office(), {});
  const Pose2 truth{0.7, -0.1, 0.2};
  const MatchResult match =
      MatchByDifferentialEvolution(prev, ViewFrom(test::Office(), truth), WidePrior(), options, SerialFor);
  ASSERT_TRUE(match.converged);
  EXPECT_EQ(match.iterations, 50);
  EXPECT_LT(OffsetOf(match, truth), 0.05);
  EXPECT_LT(TurnOf(match, truth), 0.02);
}

// Far from a maximum nothing determines the pose, and the answer is the prior. The result of the evolution
// stays available.
TEST(NdtDe, TheEvolvedPoseIsNotJoinedWithThePrior) {
  NdtDeOptions options;
  options.climb = false;
  options.evolution.generations = 0;
  const std::vector<Eigen::Vector2d> points = PositionsOf(ViewFrom(test::Office(), {}));
  const MatchPrior sure{{}, Eigen::Vector3d(1e-8, 1e-8, 1e-8).asDiagonal()};
  const NdtDeMatch match =
      SearchNdt(points, PositionsOf(ViewFrom(test::Office(), {0.7, 0.0, 0.0})), sure, options, SerialFor);
  EXPECT_GT(match.T_evolved.x, 0.1);  // A member of the first population, not the prior.
  EXPECT_LT(std::abs(match.result.T_ref_curr.x), 0.01);
}

TEST(NdtDe, TheFitnessIsSmallWhereTheMatchIsRightAndLargeWhereNot) {
  const std::vector<Eigen::Vector2d> prev = PositionsOf(ViewFrom(test::Office(), {}));
  const NdtDeMatch right =
      SearchNdt(prev, PositionsOf(ViewFrom(test::Office(), {0.4, 0, 0.1})), WidePrior(), {}, SerialFor);
  EXPECT_TRUE(right.result.converged);
  EXPECT_LT(right.fitness, 30.0);  // The threshold of the thesis (5.1.3).
  EXPECT_GT(right.self_score, 100.0);
  // The motion is larger than the search space.
  const NdtDeMatch wrong =
      SearchNdt(prev, PositionsOf(ViewFrom(test::Office(), {0.4, 0, 1.2})), WidePrior(), {}, SerialFor);
  EXPECT_GT(wrong.fitness, 30.0);
  EXPECT_FALSE(wrong.result.converged);
}

TEST(NdtDe, TheSearchSpaceLiesInTheRobotsAxesAtThePrior) {
  // After a turn of 90 degrees, the robot's x axis is the y axis of the previous scan: one metre along it is
  // found, one metre across is not.
  const ScanView prev = ViewFrom(test::Office(), {}, test::FullTurnLaser());
  const Pose2 prior{0, 0, kPi / 2}, ahead{0.0, 0.9, kPi / 2}, aside{0.9, 0.0, kPi / 2};
  NdtDeOptions options;
  options.climb = false;  // The climb may leave the search space, so it is off.
  const auto error = [&](const Pose2& truth) {
    const ScanView curr = ViewFrom(test::Office(), truth, test::FullTurnLaser());
    return OffsetOf(MatchByDifferentialEvolution(prev, curr, WidePrior(prior), options, SerialFor), truth);
  };
  EXPECT_LT(error(ahead), 0.05);
  EXPECT_GT(error(aside), 0.2);
}

TEST(NdtDe, SameBytesOnAnyNumberOfThreads) {
  const ScanView prev = ViewFrom(test::Office(), {}), curr = ViewFrom(test::Office(), {0.3, 0.1, 0.1});
  const MatchResult serial = MatchByDifferentialEvolution(prev, curr, WidePrior(), {}, SerialFor);
  const MatchResult threads = MatchByDifferentialEvolution(prev, curr, WidePrior(), {}, ThreeThreads);
  EXPECT_EQ(serial.T_ref_curr, threads.T_ref_curr);
  EXPECT_EQ(serial.covariance, threads.covariance);
  EXPECT_EQ(serial.inliers, threads.inliers);
  // The seed is an option and not a clock. Another seed draws another population.
  NdtDeOptions other;
  other.climb = false;
  const Pose2 first = MatchByDifferentialEvolution(prev, curr, WidePrior(), other, SerialFor).T_ref_curr;
  other.seed = 2;
  EXPECT_NE(first, MatchByDifferentialEvolution(prev, curr, WidePrior(), other, SerialFor).T_ref_curr);
}

TEST(NdtDe, ACorridorIsFlagged) {
  test::ExpectACorridorIsFlagged(MatchNdtDe);
}

TEST(NdtDe, WithoutPointsTheAnswerIsThePrior) {
  test::ExpectWithoutPointsTheAnswerIsThePrior(MatchNdtDe);
}

TEST(NdtDe, OneWallIsFlagged) {
  const ScanView prev = ViewFrom(test::OneWall(), {}), curr = ViewFrom(test::OneWall(), {0.0, 0.08, 0.02});
  const MatchResult match = MatchByDifferentialEvolution(prev, curr, WidePrior(), {}, SerialFor);
  ASSERT_TRUE(match.converged);
  EXPECT_TRUE(match.degenerate);
  EXPECT_NEAR(match.T_ref_curr.y, 0.08, 0.02);
}

}  // namespace
}  // namespace cairn::slam
