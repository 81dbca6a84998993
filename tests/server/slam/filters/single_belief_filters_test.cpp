// The filters with one hypothesis: EKF-SLAM, deterministic landmark correction, and none.
#include <gtest/gtest.h>

#include "server/slam/ekf/ekf_slam.h"
#include "server/slam/reckoning/dead_reckoning_filter.h"
#include "server/slam/reckoning/landmark_correction.h"

namespace cairn::slam {
namespace {

BackEndOptions WideDrift() {
  BackEndOptions options;
  options.drift = {0.0, 0.05, 0.0, 0.0, 0.02, 0.0};
  return options;
}

void DriveSteps(Filter& filter, const std::vector<Pose2>& steps) {
  for (const Pose2& step : steps) {
    filter.Predict({step});
    filter.Commit();
  }
}

// Ten metres out, a turn, and ten metres back according to the odometry, which ends half a metre to the left
// of the truth.
std::vector<Pose2> OutTurnAndBack() {
  std::vector<Pose2> steps(20, {0.5, 0, 0});
  steps.push_back({0, 0, kPi});
  steps.insert(steps.end(), 20, {0.5, -0.025, 0});
  return steps;
}

std::vector<LandmarkSighting> SightTwoCorners(const Pose2& T_map_robot, std::size_t first_slot = 0) {
  const Pose2 T_robot_map = T_map_robot.Inverse();
  return {{first_slot, {true, 1.5}, T_robot_map * Eigen::Vector2d(2.0, 1.0), WrapAngle(0.3 - T_map_robot.theta)},
          {first_slot + 1, {true, -1.5}, T_robot_map * Eigen::Vector2d(1.0, -2.0), WrapAngle(1.2 - T_map_robot.theta)}};
}

RevisitObservation AtTheStart() {
  return {0, {0, 0, kPi}, Eigen::Vector3d(0.0025, 0.0025, 0.0004).asDiagonal()};
}

TEST(EkfSlam, ARevisitMovesTheRobotAndThePathBehindIt) {
  EkfSlam filter({}, WideDrift(), {});
  filter.Commit();
  DriveSteps(filter, OutTurnAndBack());
  EXPECT_NEAR(filter.estimate().T_map_robot.y, 0.5, 1e-9);
  const double before = filter.estimate().covariance.trace();
  const Pose2 way = filter.hypothesis(0).path[30];
  ASSERT_TRUE(filter.Observe(AtTheStart()));
  filter.Commit();
  EXPECT_LT(filter.estimate().T_map_robot.translation().norm(), 0.1);
  EXPECT_LT(filter.estimate().covariance.trace(), 0.2 * before);
  const double moved = way.y - filter.hypothesis(0).path[30].y;
  EXPECT_GT(moved, 0.05);
  EXPECT_LT(moved, 0.45);
  EXPECT_EQ(filter.hypothesis(0).path[0], Pose2{}) << "the start is certain";
}

// A large loop replaces the path, and the filter knows as much as if it had fused the loop itself.
TEST(EkfSlam, ALargeLoopMakesItAsSureAsARevisitDoes) {
  EkfSlam filter({}, WideDrift(), {}), fused({}, WideDrift(), {});
  for (EkfSlam* const one : {&filter, &fused}) {
    one->Commit();
    DriveSteps(*one, OutTurnAndBack());
  }
  const double before = filter.estimate().covariance.trace();
  ASSERT_TRUE(fused.Observe(AtTheStart()));
  fused.Commit();
  std::vector<Pose2> path;
  for (std::size_t k = 0; k < 42; ++k) path.push_back(fused.hypothesis(0).path[k]);
  ASSERT_EQ(filter.hypothesis(0).path.size(), path.size());
  filter.Rebase(path);
  filter.LearnLoop(AtTheStart());
  EXPECT_LT(Between(filter.estimate().T_map_robot, path.back()).translation().norm(), 1e-9)
      << "the path follows the loop already";
  EXPECT_TRUE(IsCovariance(filter.estimate().covariance));
  EXPECT_LT(filter.estimate().covariance.trace(), 0.2 * before);
  EXPECT_NEAR(filter.estimate().covariance.trace(), fused.estimate().covariance.trace(), 0.05 * before);
}

TEST(EkfSlam, LandmarksSeenAgainPullTheRobotBack) {
  EkfSlam filter({}, WideDrift(), {});
  filter.Observe(SightTwoCorners({}), 0.0);
  filter.Commit();
  DriveSteps(filter, OutTurnAndBack());
  filter.Observe(SightTwoCorners({0, 0, kPi}, 2), 20.0);
  filter.Commit();
  EXPECT_EQ(filter.landmarks().size(), 2U) << "seen again, not new";
  EXPECT_LT(filter.estimate().T_map_robot.translation().norm(), 0.2);
  EXPECT_EQ(filter.health().nis_dimension, 4);
  EXPECT_GT(filter.health().nis, 0.0);
}

TEST(EkfSlam, HoldsNoMoreThanItsBoundsAndStaysACovariance) {
  EkfOptions options;
  options.max_landmarks = 5;
  options.max_anchors = 3;
  EkfSlam filter(options, WideDrift(), {});
  filter.Commit();
  for (std::size_t i = 0; i < 40; ++i) {
    filter.Predict({{2.0, 0, 0}});
    filter.Observe(std::vector<LandmarkSighting>{{i, {true, 1.5}, {1.0, 1.0}, 0.2}}, 2.0 * static_cast<double>(i));
    filter.Commit();
  }
  EXPECT_EQ(filter.landmarks().size(), 5U);
  EXPECT_EQ(filter.state().size(), 3 + 5 * 2 + 3 * 3);
  EXPECT_TRUE(filter.Observe(
      {20, Between(filter.hypothesis(0).path[20], filter.estimate().T_map_robot), Eigen::Matrix3d::Identity() * 0.01}));
  filter.Commit();
  EXPECT_TRUE(IsCovariance(filter.estimate().covariance));
  EXPECT_FALSE(filter.health().diverged);
}

TEST(LandmarkCorrection, PutsTheErrorBackToTheLevelOfFirstSight) {
  LandmarkCorrection filter({}, WideDrift(), {});
  filter.Observe(SightTwoCorners({}), 0.0);
  filter.Commit();
  DriveSteps(filter, OutTurnAndBack());
  EXPECT_NEAR(filter.estimate().T_map_robot.y, 0.5, 1e-9);
  filter.Observe(SightTwoCorners({0, 0, kPi}, 2), 20.0);
  filter.Commit();
  EXPECT_LT(filter.estimate().T_map_robot.translation().norm(), 0.01);
  EXPECT_EQ(filter.landmarks().size(), 2U) << "a corner that counts is not remembered a second time";
  EXPECT_NEAR(filter.hypothesis(0).path[41].y, 0.5, 1e-9) << "the past stays";
}

TEST(LandmarkCorrection, LinesGiveTheTurnOnly) {
  LandmarkCorrection filter({}, WideDrift(), {});
  const LandmarkSighting line{0, {false, 1.0}, {2.0, 0.0}, 0.3};
  filter.Observe(std::vector<LandmarkSighting>{line}, 0.0);
  filter.Commit();
  for (int i = 0; i < 40; ++i) DriveSteps(filter, {{0.5, 0, 0}, {-0.5, 0, 0}});
  DriveSteps(filter, {{0.1, 0.0, 0.1}});
  LandmarkSighting again = line;
  again.p_robot.x() -= 0.1;
  filter.Observe(std::vector<LandmarkSighting>{again}, 40.0);
  filter.Commit();
  EXPECT_NEAR(filter.estimate().T_map_robot.theta, 0.0, 1e-9);
  EXPECT_NEAR(filter.estimate().T_map_robot.x, 0.1, 1e-9);
}

TEST(LandmarkCorrection, BeforeTravellingAFeatureCorrectsNothing) {
  CorrectionOptions options;
  options.min_travel_m = 50.0;
  LandmarkCorrection filter(options, WideDrift(), {});
  filter.Observe(SightTwoCorners({}), 0.0);
  filter.Commit();
  DriveSteps(filter, OutTurnAndBack());
  filter.Observe(SightTwoCorners({0, 0, kPi}, 2), 20.0);
  EXPECT_NEAR(filter.estimate().T_map_robot.y, 0.5, 1e-9);
  EXPECT_EQ(filter.landmarks().size(), 2U) << "but it is recognised";
}

TEST(LandmarkCorrection, AnImplausibleCorrectionIsLeftAlone) {
  BackEndOptions sure = WideDrift();
  sure.drift = {0.0, 0.001, 0.0, 0.0, 0.0001, 0.0};
  sure.landmarks.noise = {0.01, 0.003, 0.005};
  LandmarkCorrection filter({}, sure, {});
  filter.Observe(SightTwoCorners({}), 0.0);
  filter.Commit();
  DriveSteps(filter, OutTurnAndBack());
  filter.Observe(SightTwoCorners({0, 0, kPi}, 2), 20.0);
  EXPECT_NEAR(filter.estimate().T_map_robot.y, 0.5, 1e-9);
}

template <typename FilterType>
std::unique_ptr<Filter> MakeSingleBelief() {
  if constexpr (std::is_same_v<FilterType, EkfSlam>)
    return std::make_unique<EkfSlam>(EkfOptions{}, WideDrift(), Pose2{});
  if constexpr (std::is_same_v<FilterType, LandmarkCorrection>)
    return std::make_unique<LandmarkCorrection>(CorrectionOptions{}, WideDrift(), Pose2{});
  return std::make_unique<DeadReckoningFilter>(WideDrift(), Pose2{});
}

template <typename FilterType>
class SingleBelief : public testing::Test {};
using Filters = testing::Types<EkfSlam, LandmarkCorrection, DeadReckoningFilter>;
TYPED_TEST_SUITE(SingleBelief, Filters);

TYPED_TEST(SingleBelief, SaysThatItIsWrongOnceRevisitsContradictItAgainAndAgain) {
  const auto filter = MakeSingleBelief<TypeParam>();
  filter->Commit();
  DriveSteps(*filter, OutTurnAndBack());
  const Pose2 before = filter->estimate().T_map_robot;
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(filter->health().diverged);
    EXPECT_FALSE(filter->Observe({0, {-8, 4, kPi}, Eigen::Matrix3d::Identity() * 1e-4}));
  }
  EXPECT_TRUE(filter->health().diverged);
  EXPECT_EQ(filter->estimate().T_map_robot, before);
  (void)filter->Observe(AtTheStart());
  EXPECT_FALSE(filter->health().diverged) << "explained again";
}

TYPED_TEST(SingleBelief, StandsAnEmptyScan) {
  const auto filter = MakeSingleBelief<TypeParam>();
  const Scan scan;
  const ScanView view;
  filter->Observe({scan, view, {}, 0.0}, SerialFor);
  filter->Commit();
  EXPECT_TRUE(filter->landmarks().empty());
  EXPECT_EQ(filter->estimate().T_map_robot, Pose2{});
}

TEST(DeadReckoningFilter, UncertaintyIsThatOfTheDrift) {
  DeadReckoningFilter filter(WideDrift(), {});
  filter.Commit();
  DriveSteps(filter, std::vector<Pose2>(4, {1.0, 0, 0}));
  EXPECT_NEAR(filter.estimate().covariance(0, 0), 4 * 0.05 * 0.05, 1e-12);
  EXPECT_NEAR(filter.estimate().covariance(2, 2), 4 * 0.02 * 0.02, 1e-12);
}

}  // namespace
}  // namespace cairn::slam
