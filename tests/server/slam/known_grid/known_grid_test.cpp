// A map that others have made: its surfaces, how scans agree with it, and a robot that is only localised in it.
#include "server/slam/known_grid/known_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <variant>
#include <vector>

#include "server/slam/scan/beam_points.h"
#include "tests/server/slam/known_grid/half_mapped.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

using test::KnownGridOf;
using test::Localised;
using test::Mapped;
using test::MappedOutcomes;

// A room of 8 x 6 m, as scans from some places in it have drawn it.
class KnownRoom : public ::testing::Test {
 protected:
  KnownRoom() {
    OccupancyGrid grid{GridOptions{}};
    for (double x = -2.0; x <= 2.0; x += 0.5)
      for (const double y : {-1.0, 1.0}) grid.Draw(LookAt({x, y, x}), {x, y, x});
    map_ = KnownGridOf(grid);
  }
  Scan LookAt(const Pose2& T_map_robot) { return test::Look(world_, T_map_robot, {.range_max_m = 12.0}, &rng_); }

  const test::World world_ = test::Room(-4.0, -3.0, 8.0, 6.0);
  std::mt19937_64 rng_{3};
  std::shared_ptr<const KnownGrid> map_;
};

TEST_F(KnownRoom, ItsSurfacesLieOnTheWallsAndFaceTheRoom) {
  int smooth = 0, beside = 0, turned_away = 0;
  for (const SurfacePoint& surface : map_->Index()->surfaces) {
    if (!surface.smooth()) continue;
    ++smooth;
    const double to_wall_m = std::min(std::abs(std::abs(surface.p.x()) - 4.0), std::abs(std::abs(surface.p.y()) - 3.0));
    beside += to_wall_m > 0.05 ? 1 : 0;
    turned_away += surface.normal.dot(surface.p) > 0.0 ? 1 : 0;
  }
  EXPECT_GT(smooth, 300);
  EXPECT_LT(beside, smooth / 20);
  EXPECT_LT(turned_away, smooth / 20);
}

TEST_F(KnownRoom, AScanAgreesWhereItWasTakenAndContradictsElsewhere) {
  const Pose2 truth{0.5, 0.3, 0.4};
  const Scan scan = LookAt(truth);
  const std::vector<SurfacePoint> points = SurfacePointsOf(PointsOf(scan), scan, {});
  const VisibilityCounts right = map_->Compare(scan, points, truth);
  EXPECT_GT(right.confirmed, 50);
  EXPECT_EQ(right.contradicted, 0);
  const VisibilityCounts wrong = map_->Compare(scan, points, truth * Pose2{1.0, 0.0, 0.5});
  EXPECT_GT(wrong.contradicted, wrong.known() / 3);
  // Where the map shows nothing, nothing is known.
  EXPECT_EQ(map_->Compare(scan, points, {100.0, 100.0, 0.0}).known(), 0);
}

TEST_F(KnownRoom, ACellHasTheValueOfTheMap) {
  EXPECT_LE(map_->At({0.0, 0.0}), 35);
  EXPECT_GE(map_->At({3.99, 0.0}), 50);
  EXPECT_EQ(map_->At({50.0, 0.0}), kUnknownCell);
}

TEST(LocaliseIn, ARobotThatIsLookedForEverywhereIsFoundAndFollowed) {
  Localised robot;
  ASSERT_TRUE(robot.pipeline.mapper().LocaliseIn(Mapped().map, false));
  EXPECT_TRUE(robot.pipeline.mapper().localises());
  robot.Add(Mapped().half, Mapped().drive.records.size());
  ASSERT_GT(robot.outcomes.size(), 400U);
  EXPECT_FALSE(robot.outcomes.front().localized);
  EXPECT_GT(robot.localized(), robot.outcomes.size() * 8 / 10);
  const std::vector<ScanOutcome>& mapped = MappedOutcomes();
  std::size_t compared = 0;
  for (const ScanOutcome& one : robot.outcomes) {
    const auto same =
        std::find_if(mapped.begin(), mapped.end(), [&](const ScanOutcome& other) { return other.stamp == one.stamp; });
    if (same == mapped.end() || !one.localized) continue;
    ++compared;
    // The robot that maps bends its map on the second half as well.
    EXPECT_LT((one.T_map_robot.translation() - same->T_map_robot.translation()).norm(), 0.3);
  }
  EXPECT_GT(compared, 300U);
  // Nothing was mapped.
  EXPECT_EQ(robot.pipeline.mapper().keyframe_count(), 0U);
  EXPECT_EQ(robot.pipeline.mapper().grid().chunk_count(), 0U);
}

TEST(LocaliseIn, ARobotWhosePlaceIsKnownIsLocalizedWithItsFirstScan) {
  Localised robot(Mapped().drive.T_map_robot_start);
  ASSERT_TRUE(robot.pipeline.mapper().LocaliseIn(Mapped().map, true));
  robot.Add(0, Mapped().half);
  EXPECT_TRUE(robot.outcomes.front().localized);
  EXPECT_EQ(robot.localized(), robot.outcomes.size());
}

// Odometry begins anywhere.
TEST(LocaliseIn, ARobotIsLookedForWhereItIsSaidToStartWhateverItsOdometryIs) {
  Localised robot(Mapped().drive.T_map_robot_start);
  ASSERT_TRUE(robot.pipeline.mapper().LocaliseIn(Mapped().map, true));
  const Pose2 T_other_odom{40.0, -7.0, 2.0};
  for (std::size_t i = 0; i < Mapped().half / 2; ++i) {
    if (const auto* odometry = std::get_if<Odometry>(&Mapped().drive.records[i])) {
      Odometry moved = *odometry;
      moved.T_odom_robot = T_other_odom * moved.T_odom_robot;
      robot.pipeline.Add(moved);
    } else {
      robot.Add(i, i + 1);
    }
  }
  EXPECT_TRUE(robot.outcomes.front().localized);
  EXPECT_EQ(robot.localized(), robot.outcomes.size());
}

// A robot that was carried during a pause, after which its first scan is tilted.
TEST(LocaliseIn, APauseIsNotForgottenBecauseTheScanAfterItIsTilted) {
  Localised robot(Mapped().drive.T_map_robot_start);
  ASSERT_TRUE(robot.pipeline.mapper().LocaliseIn(Mapped().map, true));
  robot.Add(0, Mapped().half / 2);
  ASSERT_TRUE(robot.outcomes.back().localized);
  const std::size_t before = robot.outcomes.size();
  bool tilted = false;
  for (std::size_t i = Mapped().half; i < Mapped().half + 60; ++i) {
    const auto* const scan = std::get_if<Scan>(&Mapped().drive.records[i]);
    if (scan != nullptr && !tilted) {
      tilted = true;
      auto changed = std::make_shared<Scan>(*scan);
      changed->tilt_rad = 0.2;
      robot.pipeline.Add(std::move(changed));
    } else {
      robot.Add(i, i + 1);
    }
  }
  ASSERT_GT(robot.outcomes.size(), before + 2);
  EXPECT_FALSE(robot.outcomes[before].localized);
  EXPECT_FALSE(robot.outcomes[before + 1].localized);
}

TEST(LocaliseIn, AMapOfTooLargeAnAreaIsNone) {
  KnownGrid::Source source{Mapped().map->source().tiles, 0.05, 0};
  EXPECT_TRUE(KnownGrid::IsBounded(source));
  source.tiles.emplace(ChunkKey{400, 0}, source.tiles.begin()->second);
  EXPECT_FALSE(KnownGrid::IsBounded(source));
  EXPECT_FALSE(KnownGrid::IsBounded({{}, std::nan(""), 0}));
  EXPECT_FALSE(KnownGrid::IsBounded({{{ChunkKey{1 << 21, 0}, source.tiles.begin()->second}}, 0.05, 0}));
}

TEST(LocaliseIn, ASavedRobotGoesOnWithTheSameBytes) {
  Localised whole, first, second;
  for (Localised* const robot : {&whole, &first}) ASSERT_TRUE(robot->pipeline.mapper().LocaliseIn(Mapped().map, false));
  const std::size_t from = Mapped().half, to = Mapped().drive.records.size(), stop = (from + to) / 2;
  whole.Add(from, to);
  first.Add(from, stop);
  std::string bytes, again;
  first.pipeline.Save(bytes);
  ASSERT_TRUE(second.pipeline.Load(bytes));
  EXPECT_TRUE(second.pipeline.mapper().localises());
  second.pipeline.Save(again);
  EXPECT_TRUE(again == bytes);
  second.Add(stop, to);
  ASSERT_EQ(first.outcomes.size() + second.outcomes.size(), whole.outcomes.size());
  for (std::size_t i = 0; i < second.outcomes.size(); ++i) {
    const ScanOutcome& one = whole.outcomes[first.outcomes.size() + i];
    ASSERT_EQ(second.outcomes[i].T_map_robot, one.T_map_robot);
    ASSERT_EQ(second.outcomes[i].localized, one.localized);
  }
}

TEST(LocaliseIn, ARobotIsNotLocalizedInAnotherBuilding) {
  const test::World hall = test::Room(0.0, 0.0, 23.0, 17.0);
  OccupancyGrid grid{GridOptions{}};
  std::mt19937_64 rng{3};
  for (double x = 2.0; x < 22.0; x += 1.0)
    grid.Draw(test::Look(hall, {x, 8.0, 0.0}, {.range_max_m = 25.0}, &rng), {x, 8.0, 0.0});
  Localised robot(Mapped().drive.T_map_robot_start);
  ASSERT_TRUE(robot.pipeline.mapper().LocaliseIn(KnownGridOf(grid), true));
  robot.Add(0, Mapped().half);
  EXPECT_EQ(robot.localized(), 0U);
}

TEST(LocaliseIn, AMapThatHasMovedIsLookedAtAgain) {
  Localised robot(Mapped().drive.T_map_robot_start);
  Mapper& mapper = robot.pipeline.mapper();
  ASSERT_TRUE(mapper.LocaliseIn(Mapped().map, true));
  robot.Add(0, Mapped().half / 2);
  ASSERT_TRUE(robot.outcomes.back().localized);
  // The same map: the next scan shows that the robot is where it was.
  ASSERT_TRUE(mapper.LocaliseIn(Mapped().map, true));
  robot.Add(Mapped().half / 2, Mapped().half);
  EXPECT_TRUE(robot.outcomes.back().localized);
  // All of it lies elsewhere: the robot is found there, and not said to be where it was.
  KnownGrid::Tiles moved;
  for (const auto& [key, cells] : Mapped().map->source().tiles) moved.emplace(ChunkKey{key.x + 2, key.y}, cells);
  const MapperOptions options;
  ASSERT_TRUE(mapper.LocaliseIn(
      std::make_shared<const KnownGrid>(KnownGrid::Source{moved, Mapped().map->source().resolution_m, 0},
                                        options.recovery.place, options.self_check.near_m),
      true));
  const std::size_t before = robot.outcomes.size();
  robot.Add(Mapped().half, Mapped().drive.records.size());
  const std::vector<ScanOutcome>& mapped = MappedOutcomes();
  const double shift_m = 2.0 * kTileCells * Mapped().map->source().resolution_m;
  std::size_t localized = 0;
  for (std::size_t i = before; i < robot.outcomes.size(); ++i) {
    if (!robot.outcomes[i].localized) continue;
    ++localized;
    EXPECT_NEAR(robot.outcomes[i].T_map_robot.x, mapped[i].T_map_robot.x + shift_m, 0.25);
  }
  EXPECT_GT(localized, 50U);
}

TEST(LocaliseIn, ARobotThatIsLocalizedMapsAgainFromWhereItIs) {
  Localised robot(Mapped().drive.T_map_robot_start);
  Mapper& mapper = robot.pipeline.mapper();
  ASSERT_TRUE(mapper.LocaliseIn(Mapped().map, true));
  EXPECT_FALSE(mapper.LocaliseIn(nullptr, true));  // Its place is not known yet.
  robot.Add(0, Mapped().half / 2);
  const Pose2 before = robot.outcomes.back().T_map_robot;
  ASSERT_TRUE(mapper.LocaliseIn(nullptr, true));
  EXPECT_FALSE(mapper.localises());
  const std::size_t from = robot.outcomes.size();
  robot.Add(Mapped().half / 2, Mapped().half);
  EXPECT_LT((robot.outcomes[from].T_map_robot.translation() - before.translation()).norm(), 0.3);
  EXPECT_TRUE(robot.outcomes.back().localized);
  EXPECT_GT(mapper.keyframe_count(), 10U);
}

TEST(LocaliseIn, ARobotThatHasMappedKeepsItsMapMeanwhile) {
  Localised robot(Mapped().drive.T_map_robot_start);
  Mapper& mapper = robot.pipeline.mapper();
  robot.Add(0, Mapped().half / 2);
  const std::size_t keyframes = mapper.keyframe_count();
  ASSERT_TRUE(mapper.LocaliseIn(Mapped().map, true));
  robot.Add(Mapped().half / 2, Mapped().half);
  EXPECT_TRUE(robot.outcomes.back().localized);
  EXPECT_EQ(mapper.keyframe_count(), keyframes);
  EXPECT_EQ(mapper.Snapshot().keyframes.size(), keyframes);
  ASSERT_TRUE(mapper.LocaliseIn(nullptr, true));
  robot.Add(Mapped().half, Mapped().drive.records.size());
  EXPECT_TRUE(robot.outcomes.back().localized);
  EXPECT_GT(mapper.keyframe_count(), keyframes);
}

}  // namespace
}  // namespace cairn::slam
