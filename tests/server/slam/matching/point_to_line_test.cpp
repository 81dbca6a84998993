#include "server/slam/matching/point_to_line.h"

#include <gtest/gtest.h>

#include "server/slam/matching/point_index.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::Look;
using test::World;

std::vector<SurfacePoint> SurfaceOf(const Scan& scan, const SurfaceOptions& options = {}) {
  return SurfacePointsOf(PointsOf(scan), scan, options);
}

// The reference holds what the robot sees from the world's origin.
PointIndex ReferenceOf(const World& world, const Laser& laser) {
  return PointIndex(SurfaceOf(Look(world, {}, laser)));
}

const Eigen::Matrix3d kPrior = Eigen::Vector3d(0.09, 0.09, 0.04).asDiagonal();

TEST(PointToLine, FindsTheWayBackFromSeveralStartingErrors) {
  const Laser laser{.beams = 361, .step_rad = Radians(0.5)};
  const PointIndex reference = ReferenceOf(test::Office(), laser);
  const Pose2 truth{0.12, -0.08, 0.06};
  const std::vector<SurfacePoint> points = SurfaceOf(Look(test::Office(), truth, laser));
  for (const Pose2 error : {Pose2{}, Pose2{0.1, 0.1, 0.05}, Pose2{-0.15, 0.05, -0.1}, Pose2{0.0, -0.2, 0.12}}) {
    const Pose2 guess = truth * error;
    const MatchResult match = AlignPointsToSurfaces(points, reference, {guess, guess, kPrior}, {});
    ASSERT_TRUE(match.converged);
    EXPECT_LT((match.T_ref_curr.translation() - truth.translation()).norm(), 0.01);
    EXPECT_LT(std::abs(AngleDiff(match.T_ref_curr.theta, truth.theta)), 0.004);
    EXPECT_TRUE(IsCovariance(match.covariance));
    EXPECT_FALSE(match.degenerate);
  }
}

TEST(PointToLine, SaysThatACorridorHoldsOnlyOneDirection) {
  World corridor;
  corridor.Add({{-50, 1}, {50, 1}}).Add({{-50, -1}, {50, -1}});
  // Far hits are a metre apart on these walls, so a wall's direction is visible only from several of them.
  const Laser laser{.beams = 361, .step_rad = Radians(0.5)};
  const PointIndex reference = ReferenceOf(corridor, laser);
  const std::vector<SurfacePoint> points = SurfaceOf(Look(corridor, {0.3, 0.05, 0.03}, laser));
  const Pose2 guess{0.4, 0.0, 0.0};
  const MatchResult match = AlignPointsToSurfaces(points, reference, {guess, guess, kPrior}, {});
  ASSERT_TRUE(match.converged);
  EXPECT_TRUE(match.degenerate);
  EXPECT_GT(std::abs(match.degenerate_direction.x()), 0.99);
  EXPECT_NEAR(match.T_ref_curr.y, 0.05, 0.01);  // The walls determine y.
  EXPECT_NEAR(match.T_ref_curr.theta, 0.03, 0.005);
  // Nothing determines x, so the answer stays near guess and truth, which are 0.1 m apart, and reports a
  // large uncertainty.
  EXPECT_NEAR(match.T_ref_curr.x, 0.35, 0.1);
  EXPECT_GT(match.covariance(0, 0), 20.0 * match.covariance(1, 1));
}

// The walls of a corridor whose hits have noise, and the same with four pillars at its walls.
MatchResult InACorridor(bool pillars) {
  World corridor;
  corridor.Add({{-50, 1}, {50, 1}}).Add({{-50, -1}, {50, -1}});
  if (pillars)
    for (const double x : {2.0, 3.0, 4.0, 5.0}) corridor.Add({{x, 1}, {x, 0.9}, {x + 0.3, 0.9}, {x + 0.3, 1}});
  const Laser laser{.beams = 361, .step_rad = Radians(0.5), .sigma_m = 0.01};
  std::mt19937_64 rng(3);
  const PointIndex reference(SurfaceOf(Look(corridor, {}, laser, &rng)));
  return AlignPointsToSurfaces(SurfaceOf(Look(corridor, {0.1, 0.0, 0.0}, laser, &rng)), reference,
                               {{0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}, kPrior}, {});
}

TEST(PointToLine, SaysHowMuchOfTheWayAlongACorridorSurfacesShow) {
  const MatchResult bare = InACorridor(false), pillars = InACorridor(true);
  ASSERT_TRUE(bare.degenerate && pillars.degenerate);
  EXPECT_LT(bare.open_information, 1.0 / (1.0 * 1.0)) << "noise in the directions of the walls shows no position";
  EXPECT_GT(pillars.open_information, 1.0 / (0.1 * 0.1));
}

TEST(PointToLine, AlongACorridorTheAnswerIsWeighedWithThePrior) {
  MatchResult match = InACorridor(false);
  match.T_ref_curr = {1.0, 0.2, 0.1};
  match.degenerate_direction = {1.0, 0.0};
  const MatchPrior prior{{3.0, 0.5, 0.3}, PoseCovariance(0.1, 0.5)};
  match.open_information = 0.0;
  MatchResult weighed = match;
  WeighAlongWithPrior(prior, weighed);
  EXPECT_EQ(weighed.T_ref_curr, (Pose2{3.0, 0.2, 0.1}));
  EXPECT_NEAR(weighed.covariance(0, 0), 0.01, 1e-12);
  match.open_information = 300.0;  // Three times as much as that of the prior.
  weighed = match;
  WeighAlongWithPrior(prior, weighed);
  EXPECT_NEAR(weighed.T_ref_curr.x, 1.5, 1e-12);
  EXPECT_EQ(weighed.T_ref_curr.y, 0.2);
  EXPECT_NEAR(weighed.covariance(0, 0), 0.0025, 1e-12);
  EXPECT_EQ(weighed.open_information, 300.0);
  match.degenerate = false;
  WeighAlongWithPrior(prior, match);
  EXPECT_EQ(match.T_ref_curr, (Pose2{1.0, 0.2, 0.1}));
}

TEST(PointToLine, WithoutPointsTheAnswerIsThePrior) {
  const PointIndex reference = ReferenceOf(test::Office(), {});
  const MatchResult match = AlignPointsToSurfaces({}, reference, {{1, 0, 0}, {2, 0, 0}, kPrior}, {});
  EXPECT_FALSE(match.converged);
  EXPECT_EQ(match.failure, MatchFailure::kTooFewFeatures);
  EXPECT_EQ(match.T_ref_curr, (Pose2{2, 0, 0}));
}

TEST(PointToLine, ScansOfDifferentPlacesDoNotConverge) {
  const PointIndex reference = ReferenceOf(test::Room(-8, -8, 16, 16), {});
  const std::vector<SurfacePoint> points = SurfaceOf(Look(test::Office(), {}, {}));
  EXPECT_FALSE(AlignPointsToSurfaces(points, reference, {{}, {}, kPrior}, {}).converged);
}

}  // namespace
}  // namespace cairn::slam
