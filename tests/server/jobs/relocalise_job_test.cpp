// A robot that is looked for in the map of others, which is made here without an estimator.
#include "server/jobs/relocalise_job.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "server/slam/known_grid/known_grid.h"
#include "server/slam/loops/unique_pose.h"
#include "server/slam/site/session_map.h"
#include "tests/server/slam/site/site_drives.h"

namespace cairn::server {
namespace {

using slam::test::DriveRing;
using slam::test::RobotDrive;
using slam::test::World;
using ::testing::HasSubstr;

const slam::SiteOptions kOptions = SiteOptionsOf(slam::MapperOptions{});

// The map that a robot has drawn on a part of the ring, whose beginning is the origin of the map.
std::shared_ptr<const slam::KnownGrid> MapOf(const World& world, double from_m, double metres) {
  const RobotDrive drive = DriveRing(world, from_m, metres, {}, 1);
  slam::OccupancyGrid grid{slam::GridOptions{}};
  for (std::size_t k = 0; k < drive.truth.size(); ++k) grid.Draw(*drive.snapshot.keyframes[k].scan, drive.truth[k]);
  slam::KnownGrid::Tiles tiles;
  grid.ForEachChunk([&](const slam::ChunkKey& key, const slam::GridChunk& chunk) {
    tiles.emplace(key, std::make_shared<const TileCells>(slam::OccupanciesOf(chunk)));
  });
  return std::make_shared<const slam::KnownGrid>(
      slam::KnownGrid::Source{std::move(tiles), grid.options().resolution_m, 0}, kOptions.place,
      kOptions.self_check.near_m);
}

class LookForRobotTest : public ::testing::Test {
 protected:
  // What a robot sees that knows nothing of where it is.
  static std::vector<slam::RecentScan> ScansOf(const RobotDrive& drive) {
    const slam::SessionMap seen(0, drive.snapshot, drive.snapshot.online_path, kOptions);
    return seen.ScansAround(seen.size() - 1, slam::kStretchM);
  }
  Result<LookedFor> LookFor(const RobotDrive& drive, const slam::SearchedMap& map) {
    return LookForRobot("r1", ScansOf(drive), map, kOptions, control_);
  }

  std::vector<double> progress_;
  JobControl control_{[this](double progress) { progress_.push_back(progress); }};
};

TEST_F(LookForRobotTest, APlaceWithoutARivalIsFoundAndComesFirst) {
  const World world = slam::test::RingCorridor(true);
  const RobotDrive drive = DriveRing(world, 30.0, 20.0, {5.0, -3.0, 1.0}, 2);
  const auto looked = LookFor(drive, *MapOf(world, 0.0, 70.0));
  ASSERT_TRUE(looked) << looked.error().message;
  ASSERT_TRUE(looked->found) << looked->outcome.message;
  EXPECT_LT((looked->found->T_map_robot.translation() - drive.truth.back().translation()).norm(), 0.3);
  const std::vector<PoseHypothesis>& places = looked->outcome.places;
  ASSERT_FALSE(places.empty());
  EXPECT_EQ(places.front().T_map_robot, looked->found->T_map_robot);
  EXPECT_EQ(places.front().stamp, drive.snapshot.scans.back().stamp);
  EXPECT_TRUE(std::ranges::is_sorted(places, std::greater<>(), &PoseHypothesis::weight));
  const double sum = std::accumulate(places.begin(), places.end(), 0.0,
                                     [](double total, const PoseHypothesis& one) { return total + one.weight; });
  EXPECT_NEAR(sum, 1.0, 1e-9);
  EXPECT_THAT(looked->outcome.message, HasSubstr("r1 was found at"));
  EXPECT_TRUE(std::ranges::is_sorted(progress_));
  EXPECT_LE(progress_.back(), 1.0);
}

// Along a side, every place looks like the one 4 m further on.
TEST_F(LookForRobotTest, WhereRoomsAreAlikeThePlacesAreRankedAndNoneIsFound) {
  const World world = slam::test::RingOfEqualRooms();
  const RobotDrive drive = DriveRing(world, 16.0, 5.0, {}, 2);
  const auto looked = LookFor(drive, *MapOf(world, 0.0, 36.0));
  ASSERT_TRUE(looked) << looked.error().message;
  EXPECT_FALSE(looked->found);
  Job job;
  job.places = looked->outcome.places;
  ASSERT_GE(job.places.size(), 2U);
  EXPECT_LE(job.places.size(), kMostHypotheses);
  EXPECT_GT(Ambiguity(job), kOptions.loop.max_rival);
  EXPECT_THAT(looked->outcome.message, HasSubstr("nothing was changed"));
  EXPECT_THAT(looked->outcome.message, HasSubstr("--here"));
}

TEST_F(LookForRobotTest, WhereRoomsAreAlikeThatWhichSomebodyHasSaidIsFound) {
  const World world = slam::test::RingOfEqualRooms();
  const RobotDrive drive = DriveRing(world, 16.0, 5.0, {}, 2);
  const auto map = MapOf(world, 0.0, 36.0);
  const Pose2& T_map_robot = drive.truth.back();
  const auto look = [&](const Pose2& T_map_said) {
    return LookForRobot("r1", ScansOf(drive), *map, kOptions, control_, T_map_said);
  };
  const auto looked = look(T_map_robot * Pose2{0.3, -0.2, 0.1});
  ASSERT_TRUE(looked) << looked.error().message;
  ASSERT_TRUE(looked->found) << looked->outcome.message;
  EXPECT_LT((looked->found->T_map_robot.translation() - T_map_robot.translation()).norm(), 0.3);
  ASSERT_EQ(looked->outcome.places.size(), 1U);
  EXPECT_THAT(looked->outcome.message, HasSubstr("where somebody said"));
  // What it sees contradicts the place: that is as if nobody had said anything.
  const auto wrong = look(T_map_robot * Pose2{0.0, 0.0, kPi / 2});
  ASSERT_TRUE(wrong) << wrong.error().message;
  EXPECT_FALSE(wrong->found);
  EXPECT_GE(wrong->outcome.places.size(), 2U);
}

TEST_F(LookForRobotTest, APlaceThatTheMapDoesNotShowIsNotFound) {
  const World world = slam::test::RingCorridor(true);
  const auto looked = LookFor(DriveRing(world, 60.0, 12.0, {}, 2), *MapOf(world, 0.0, 24.0));
  ASSERT_TRUE(looked) << looked.error().message;
  EXPECT_FALSE(looked->found);
  EXPECT_THAT(looked->outcome.message, HasSubstr("nothing was changed"));
}

TEST_F(LookForRobotTest, ACancelledJobEndsAtTheNextSearch) {
  const World world = slam::test::RingCorridor(true);
  control_.Cancel();
  const auto looked = LookFor(DriveRing(world, 4.0, 6.0, {}, 2), *MapOf(world, 0.0, 20.0));
  ASSERT_FALSE(looked);
  EXPECT_EQ(looked.error().code, StatusCode::kCancelled);
  EXPECT_LE(progress_.size(), 2U);
}

TEST_F(LookForRobotTest, WithoutScansNothingCanBeLookedFor) {
  const auto looked = LookForRobot("r1", {}, *MapOf(slam::test::RingCorridor(true), 0.0, 8.0), kOptions, control_);
  ASSERT_FALSE(looked);
  EXPECT_EQ(looked.error().code, StatusCode::kFailedPrecondition);
  EXPECT_THAT(looked.error().message, HasSubstr("has sent no scan"));
}

}  // namespace
}  // namespace cairn::server
