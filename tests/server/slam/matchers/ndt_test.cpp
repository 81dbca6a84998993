#include "server/slam/matchers/ndt.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "server/slam/features/scan_view.h"
#include "tests/server/slam/matchers/ndt_worlds.h"
#include "tests/server/slam/nees_bounds.h"

namespace cairn::slam {
namespace {

using test::OffsetOf;
using test::TurnOf;
using test::ViewFrom;
using test::WidePrior;

MatchResult MatchNdt(const ScanView& prev, const ScanView& curr, const MatchPrior& prior) {
  return MatchByNdt(prev, curr, prior, {}, SerialFor);
}

TEST(Ndt, FindsTheMotionWithoutNoise) {
  const ScanView prev = ViewFrom(test::Office(), {});
  for (const Pose2& truth : {Pose2{}, Pose2{0.2, 0.0, 0.0}, Pose2{0.1, -0.1, 0.1}, Pose2{-0.15, 0.1, -0.15}}) {
    const MatchResult match = MatchByNdt(prev, ViewFrom(test::Office(), truth), WidePrior(), {}, SerialFor);
    ASSERT_TRUE(match.converged) << truth.x << ' ' << truth.theta;
    EXPECT_LT(OffsetOf(match, truth), 0.01);
    EXPECT_LT(TurnOf(match, truth), 0.004);
    EXPECT_GT(match.score, 0.9);
    EXPECT_TRUE(IsCovariance(match.covariance));
    EXPECT_FALSE(match.degenerate);
  }
}

// The region of initial errors from which the climb reaches the answer; `cairn-study thesis-c` draws it.
TEST(Ndt, ConvergesFromThirtyCentimetresAndTenDegrees) {
  const ScanView prev = ViewFrom(test::Office(), {});
  const Pose2 truth{0.2, 0.1, 0.05};
  const ScanView curr = ViewFrom(test::Office(), truth);
  for (int direction = 0; direction < 8; ++direction) {
    const double angle = direction * kPi / 4;
    for (const double turn : {-Radians(10), 0.0, Radians(10)}) {
      const Pose2 error{0.3 * std::cos(angle), 0.3 * std::sin(angle), turn};
      const MatchResult match = MatchByNdt(prev, curr, WidePrior(truth * error), {}, SerialFor);
      EXPECT_TRUE(match.converged) << angle << ' ' << turn;
      EXPECT_LT(OffsetOf(match, truth), 0.03) << angle << ' ' << turn;
      EXPECT_LT(TurnOf(match, truth), 0.01) << angle << ' ' << turn;
    }
  }
}

// With noise of 1.5 cm on every range, over 200 pairs, the errors are as large on average as the covariance
// states.
TEST(Ndt, TheCovarianceFitsTheErrors) {
  test::Laser laser = test::kNdtLaser;
  laser.sigma_m = 0.015;
  std::mt19937_64 engine(7);
  double nees = 0.0;
  constexpr int kPairs = 200;
  for (int i = 0; i < kPairs; ++i) {
    const Pose2 from{-1.0 + 0.01 * i, 0.5, 0.03 * i}, truth{0.15, 0.03, 0.08};
    const ScanView prev = ViewFrom(test::Office(), from, laser, &engine);
    const ScanView curr = ViewFrom(test::Office(), from * truth, laser, &engine);
    const MatchResult match = MatchByNdt(prev, curr, WidePrior(truth * Pose2{0.05, 0.05, 0.03}), {}, SerialFor);
    ASSERT_TRUE(match.converged) << i;
    Eigen::Vector3d error = match.T_ref_curr.vector() - truth.vector();
    error.z() = WrapAngle(error.z());
    nees += error.dot(match.covariance.llt().solve(error)) / kPairs;
  }
  std::printf("mean NEES %.2f (3 where the covariance is right)\n", nees);
  // It should lie between 2.6 and 3.5. The covariance is too large by a third: the true value is pinned from
  // both sides.
  const test::NeesBounds bounds = test::NeesBoundsOf(kPairs, 2.21);
  EXPECT_GT(nees, bounds.low);
  EXPECT_LT(nees, bounds.high);
}

TEST(Ndt, TheInverseProblemHasTheInverseAnswer) {
  const ScanView a = ViewFrom(test::Office(), {}), b = ViewFrom(test::Office(), {0.2, -0.1, 0.12});
  const MatchResult there = MatchByNdt(a, b, WidePrior(), {}, SerialFor);
  const MatchResult back = MatchByNdt(b, a, WidePrior(), {}, SerialFor);
  ASSERT_TRUE(there.converged && back.converged);
  EXPECT_LT(OffsetOf(back, there.T_ref_curr.Inverse()), 0.015);
  EXPECT_LT(TurnOf(back, there.T_ref_curr.Inverse()), 0.005);
}

TEST(Ndt, ACorridorIsFlaggedAndTheAnswerLiesBetweenTruthAndPriorAlongIt) {
  const MatchResult match = test::ExpectACorridorIsFlagged(MatchNdt);
  EXPECT_NEAR(match.T_ref_curr.x, 0.35, 0.055);
  EXPECT_GT(match.covariance(0, 0), 10.0 * match.covariance(1, 1));
}

TEST(Ndt, OneWallIsFlagged) {
  const ScanView prev = ViewFrom(test::OneWall(), {});
  const MatchResult match = MatchByNdt(prev, ViewFrom(test::OneWall(), {0.0, 0.08, 0.02}), WidePrior(), {}, SerialFor);
  ASSERT_TRUE(match.converged);
  EXPECT_TRUE(match.degenerate);
  EXPECT_NEAR(match.T_ref_curr.y, 0.08, 0.02);
}

TEST(Ndt, WithoutPointsTheAnswerIsThePrior) {
  test::ExpectWithoutPointsTheAnswerIsThePrior(MatchNdt);
}

TEST(Ndt, ScansOfDifferentPlacesDoNotConverge) {
  const ScanView hall = ViewFrom(test::Room(-8, -8, 16, 16), {}), office = ViewFrom(test::Office(), {});
  const MatchResult match = MatchByNdt(hall, office, WidePrior(), {}, SerialFor);
  EXPECT_FALSE(match.converged);
  EXPECT_EQ(match.failure, MatchFailure::kNotConverged);
  EXPECT_LT(match.score, 0.5);
}

TEST(Ndt, TheClimbEndsHigherThanItBeganWhereThereIsSomethingToClimb) {
  const NdtMap map(PositionsOf(ViewFrom(test::Office(), {})), {});
  const std::vector<Eigen::Vector2d> points = PositionsOf(ViewFrom(test::Office(), {0.2, 0.1, 0.1}));
  for (const Pose2& start : {Pose2{}, Pose2{0.5, 0.5, 0.5}, Pose2{-1, 1, 2}, Pose2{30, 30, 0}}) {
    const NewtonResult climb = ClimbNdt(map, points, start, {});
    EXPECT_TRUE(climb.settled);
    const double before = map.Derivatives(points, start).score,
                 after = map.Derivatives(points, climb.T_map_points).score;
    if (before > 0.0) {
      EXPECT_GT(after, before);
    } else {  // Too far from the map: every density is zero.
      EXPECT_EQ(after, before);
    }
  }
}

}  // namespace
}  // namespace cairn::slam
