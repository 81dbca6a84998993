#include "server/slam/localisation/line_localization.h"

#include <gtest/gtest.h>

#include "server/slam/grid/grid_image.h"
#include "server/slam/mapper.h"
#include "server/slam/methods.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

std::shared_ptr<const std::vector<MapLine>> KnownMap(const test::World& world) {
  auto map = std::make_shared<std::vector<MapLine>>();
  for (const auto& [a, b] : world.walls) {
    map->push_back({a, b});
    map->push_back({b, a});
  }
  return map;
}

MapperOptions Options(const test::World& world) {
  MapperOptions options;
  options.filter.kind = FilterKind::kLineMatch;
  options.filter.line_match.map = KnownMap(world);
  return options;
}

// Drives round the office several times, with wheels that are 5 % wrong.
struct LostRobot {
  explicit LostRobot(const MapperOptions& options, const Pose2& T_map_robot_start = {})
      : mapper(options, T_map_robot_start, 1) {}

  ScanOutcome Step(const test::World& world, const Pose2& step = {0.15, 0.0, 0.18}) {
    if (scans > 0) {
      truth = truth * step;
      T_odom_robot = T_odom_robot * Pose2{0.95 * step.x, 0.0, 1.03 * step.theta};
    }
    test::Laser laser = test::FullTurnLaser(720);
    laser.sigma_m = 0.005;
    auto scan = std::make_shared<Scan>(test::Look(world, truth, laser, &engine));
    scan->stamp = StampFromSeconds(0.2 * ++scans);
    return mapper.Process(scan, T_odom_robot, SerialFor);
  }
  [[nodiscard]] double Error(const ScanOutcome& outcome) const {
    return (outcome.T_map_robot.translation() - truth.translation()).norm() +
           std::abs(AngleDiff(outcome.T_map_robot.theta, truth.theta));
  }

  Mapper mapper;
  std::mt19937_64 engine{3};
  Pose2 truth{0.6, -1.6, 0.2}, T_odom_robot;
  int scans = 0;
};

TEST(LineLocalization, FindsItsPlaceFromNothingAndStays) {
  LostRobot robot(Options(test::Office()));
  int lost = 0;
  for (int step = 0; step < 120; ++step) {
    const ScanOutcome outcome = robot.Step(test::Office());
    if (!outcome.localized) {
      ++lost;
      EXPECT_EQ(outcome.reason, PoseReason::kLost);
      EXPECT_GT(outcome.covariance(0, 0), 1e6);
      EXPECT_EQ(robot.mapper.grid().chunk_count(), 0U) << "drawn where nobody knows";
      EXPECT_TRUE(robot.mapper.Snapshot().keyframes.empty());
      continue;
    }
    EXPECT_LT(robot.Error(outcome), 0.06) << step;
    EXPECT_TRUE(IsCovariance(outcome.covariance));
    EXPECT_LT(outcome.covariance(0, 0), 0.01);
  }
  EXPECT_GT(lost, 3);
  EXPECT_LT(lost, 60);
  // The earlier path moved with the correction.
  const MapperSnapshot snapshot = robot.mapper.Snapshot();
  ASSERT_GT(snapshot.full_path.size(), 10U);
  EXPECT_LT((snapshot.full_path.front().translation() - Eigen::Vector2d(0.6, -1.6)).norm(), 0.1);
  EXPECT_EQ(snapshot.online_path.size(), snapshot.full_path.size());
  EXPECT_LT((snapshot.online_path.front().translation() - snapshot.full_path.front().translation()).norm(), 1e-9);
  EXPECT_GT(robot.mapper.grid().chunk_count(), 0U);
}

TEST(LineLocalization, ALogThatEndsWhereItIsPlacedHasItsWholeMap) {
  LostRobot robot(Options(test::Office()));
  while (!robot.Step(test::Office()).localized) ASSERT_LT(robot.scans, 60);
  const MapperSnapshot snapshot = robot.mapper.Snapshot();
  EXPECT_EQ(snapshot.online_path, snapshot.full_path);
  robot.mapper.FinishMap();
  OccupancyGrid whole{GridOptions{}};
  for (std::size_t k = 0; k < snapshot.keyframes.size(); ++k)
    whole.Draw(*snapshot.keyframes[k].scan, snapshot.full_path[k]);
  EXPECT_EQ(ImageOf(robot.mapper.grid()).cells, ImageOf(whole).cells);
}

TEST(LineLocalization, AGridThatComesBeforeTheRobotIsPlacedStaysAsItIs) {
  const test::World room = test::Room(-3, -3, 8, 6);
  LostRobot robot(Options(room));
  for (int step = 0; step < 20; ++step) ASSERT_FALSE(robot.Step(room).localized);
  robot.mapper.AdoptGrid(OccupancyGrid(GridOptions{}), 0);
  EXPECT_EQ(robot.mapper.grid().chunk_count(), 0U);
}

TEST(LineLocalization, AStateFromBeforeTheRobotIsPlacedCanBeLoaded) {
  LostRobot robot(Options(test::Office())), loaded(Options(test::Office()));
  for (int step = 0; step < 3; ++step) ASSERT_FALSE(robot.Step(test::Office()).localized);
  StateWriter writer;
  robot.mapper.Save(writer);
  const std::string bytes = writer.Bytes();
  StateReader reader(bytes);
  loaded.mapper.Load(reader);
  ASSERT_TRUE(reader.done()) << reader.failed();
  EXPECT_EQ(loaded.mapper.keyframe_count(), robot.mapper.keyframe_count());
}

// Before the robot is placed, its path may contradict its scans. Once it is placed, this no longer counts.
TEST(LineLocalization, ContradictionsFromBeforeTheRobotIsPlacedAreForgotten) {
  MapperOptions options = Options(test::Office());
  // Nearly every difference between scans is a contradiction.
  options.self_check = {.min_travel_m = 0.1, .near_m = 0.001, .max_conflict = 0.01};
  options.filter.line_match.every_m = 2.0;  // So that finding the place takes longer.
  LostRobot robot(options);
  bool contradicted = false;
  ScanOutcome outcome = robot.Step(test::Office());
  while (!outcome.localized && robot.scans < 150) {
    contradicted = contradicted || outcome.reason == PoseReason::kDiverged;
    outcome = robot.Step(test::Office());
  }
  EXPECT_TRUE(contradicted);
  EXPECT_TRUE(outcome.localized);
}

TEST(LineLocalization, AKnownStartIsGoodAtOnce) {
  MapperOptions options = Options(test::Office());
  options.filter.line_match.start_known = true;
  LostRobot robot(options, {0.8, -1.4, 0.3});
  EXPECT_TRUE(robot.Step(test::Office()).localized);
  ScanOutcome outcome;
  for (int step = 0; step < 20; ++step) outcome = robot.Step(test::Office());
  EXPECT_TRUE(outcome.localized);
  EXPECT_LT(robot.Error(outcome), 0.06);
}

TEST(LineLocalization, TwoSidesOfARectangleAreNeverSettled) {
  const test::World room = test::Room(-3, -3, 8, 6);
  LostRobot robot(Options(room));
  for (int step = 0; step < 60; ++step) EXPECT_FALSE(robot.Step(room).localized);
}

TEST(LineLocalization, WithoutAMapNothingIsKnown) {
  MapperOptions options;
  options.filter.kind = FilterKind::kLineMatch;
  LostRobot robot(options);
  for (int step = 0; step < 20; ++step) EXPECT_FALSE(robot.Step(test::Office()).localized);
}

// The robot is carried to a place that is not in the map and must report it. Back in the mapped rooms, it
// must localise itself again.
TEST(LineLocalization, SaysThatItIsLostAndFindsItselfAgain) {
  MapperOptions options = Options(test::Office());
  options.filter.line_match.lost_after_m = 2.0;
  LostRobot robot(options);
  for (int step = 0; step < 60; ++step) robot.Step(test::Office());
  const test::World elsewhere = test::Room(-1.5, -3, 4.2, 4.5);
  ScanOutcome outcome;
  for (int step = 0; step < 40; ++step) outcome = robot.Step(elsewhere);
  EXPECT_FALSE(outcome.localized);
  EXPECT_TRUE(outcome.reason == PoseReason::kDiverged || outcome.reason == PoseReason::kLost);
  for (int step = 0; step < 120; ++step) outcome = robot.Step(test::Office());
  EXPECT_TRUE(outcome.localized);
  EXPECT_LT(robot.Error(outcome), 0.06);
}

}  // namespace
}  // namespace cairn::slam
