// The estimator follows the path that a job has found.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "common/geometry/rotated_covariance.h"
#include "server/slam/graph/pose_graph.h"
#include "server/slam/mapper.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "server/slam/state/archive.h"
#include "tests/server/slam/ring_drive.h"

namespace cairn::slam {
namespace {

using test::Drive;
using test::DriveRound;
using test::ShareMissing;

// A job has found that the whole map lies elsewhere, and knows a path that is not quite the robot's own. From then on
// the pose, the path, the landmarks and what is drawn are those of the job's map.
TEST(MapperFollows, TheEstimatorFollowsThePathThatComesWithAGrid) {
  const Drive drive = DriveRound();
  MapperOptions options;
  options.filter.particles = 20;
  Mapper mapper(options, drive.truth.front(), 1), undisturbed(options, drive.truth.front(), 1);
  const auto process = [&](Mapper& one, std::size_t i) {
    return one.Process(drive.scans[i], drive.odometry[i], SerialFor);
  };
  for (std::size_t i = 0; i < 60; ++i) {
    static_cast<void>(process(mapper, i));
    static_cast<void>(process(undisturbed, i));
  }
  const Pose2 T_new_old{3.0, -2.0, 0.5};
  const MapperSnapshot snapshot = mapper.Snapshot();
  std::vector<Pose2> path = snapshot.full_path;
  OccupancyGrid grid(mapper.grid().options());
  for (std::size_t k = 0; k < path.size(); ++k) {
    path[k] = T_new_old * path[k];
    grid.Draw(*snapshot.keyframes[k].scan, path[k]);
  }
  for (std::size_t i = 60; i < 80; ++i) {  // While the job was at work.
    static_cast<void>(process(mapper, i));
    static_cast<void>(process(undisturbed, i));
  }
  const std::vector<Landmark> landmarks = mapper.landmarks();
  ASSERT_FALSE(landmarks.empty());
  mapper.AdoptGrid(std::move(grid), path.size(), path);

  EXPECT_EQ(mapper.BestPath().front(), path.front());
  ASSERT_EQ(mapper.BestPath().size(), mapper.keyframe_count());
  EXPECT_EQ(mapper.Snapshot().online_path, mapper.BestPath()) << "the grid is drawn along it";
  ASSERT_EQ(mapper.landmarks().size(), landmarks.size());
  EXPECT_LT((mapper.landmarks().front().p_map - T_new_old * landmarks.front().p_map).norm(), 0.05);
  OccupancyGrid expected(mapper.grid().options());
  for (std::size_t i = 80; i < 160; ++i) {
    const ScanOutcome there = process(mapper, i), here = process(undisturbed, i);
    EXPECT_LT((there.T_map_robot.translation() - T_new_old * here.T_map_robot.translation()).norm(), 0.15) << i;
    EXPECT_LT(std::abs(AngleDiff(there.T_map_robot.theta, (T_new_old * here.T_map_robot).theta)), 0.03) << i;
    EXPECT_TRUE(there.localized);
  }
  const MapperSnapshot after = mapper.Snapshot();
  for (std::size_t k = 0; k < after.keyframes.size(); ++k)
    expected.Draw(*after.keyframes[k].scan, after.online_path[k]);
  EXPECT_LT(ShareMissing(expected, mapper.grid()), 0.01);
  EXPECT_LT(ShareMissing(mapper.grid(), expected), 0.01);
}

// A map version that was made when the path was the same is no news: nobody's estimate gets worse however often the
// version is switched.
class MapperFollowsWith : public ::testing::TestWithParam<FilterKind> {
 protected:
  static MapperOptions Options() {
    MapperOptions options;
    options.filter.kind = GetParam();
    options.filter.particles = 20;
    return options;
  }
};
INSTANTIATE_TEST_SUITE_P(Filters, MapperFollowsWith,
                         ::testing::Values(FilterKind::kFastSlam2Points, FilterKind::kFastSlam2Oriented,
                                           FilterKind::kFastSlam1, FilterKind::kEkf));

TEST_P(MapperFollowsWith, ItsOwnPathChangesNothing) {
  const Drive drive = DriveRound();
  const MapperOptions options = Options();
  Mapper mapper(options, drive.truth.front(), 1), undisturbed(options, drive.truth.front(), 1);
  for (std::size_t i = 0; i < 100; ++i) {
    const auto process = [&](Mapper& one) { return one.Process(drive.scans[i], drive.odometry[i], SerialFor); };
    const ScanOutcome here = process(mapper), there = process(undisturbed);
    ASSERT_EQ(here.T_map_robot, there.T_map_robot) << i;
    ASSERT_EQ(here.covariance, there.covariance) << i;
    const std::vector<Pose2> path = mapper.BestPath();
    ASSERT_TRUE(mapper.AdoptGrid(OccupancyGrid(mapper.grid().options()), mapper.keyframes_made(), path));
  }
}

// There and back: the robot is as sure of its pose, and as near to the truth, as if the map had not been switched.
TEST_P(MapperFollowsWith, ManySwitchesBetweenTwoPathsDoNotBlurTheEstimate) {
  const Drive drive = DriveRound();
  const MapperOptions options = Options();
  Mapper mapper(options, drive.truth.front(), 1), undisturbed(options, drive.truth.front(), 1);
  const Pose2 T_new_old{3.0, -2.0, 0.5};
  bool moved = false;
  for (std::size_t i = 0; i < 100; ++i) {
    const auto process = [&](Mapper& one) { return one.Process(drive.scans[i], drive.odometry[i], SerialFor); };
    ScanOutcome here = process(mapper);
    const ScanOutcome there = process(undisturbed);
    if (moved) here.T_map_robot = T_new_old.Inverse() * here.T_map_robot;
    ASSERT_LT((here.T_map_robot.translation() - there.T_map_robot.translation()).norm(), 0.05) << i;
    ASSERT_LT(std::abs(AngleDiff(here.T_map_robot.theta, there.T_map_robot.theta)), 0.01) << i;
    const Eigen::Matrix3d expected = moved ? Rotated(there.covariance, T_new_old.theta) : there.covariance;
    ASSERT_LE((here.covariance - expected).norm(), 0.5 * expected.norm()) << i;
    std::vector<Pose2> path = mapper.BestPath();
    for (Pose2& pose : path) pose = (moved ? T_new_old.Inverse() : T_new_old) * pose;
    moved = !moved;
    ASSERT_TRUE(mapper.AdoptGrid(OccupancyGrid(mapper.grid().options()), mapper.keyframes_made(), path));
  }
}

// The pose of a scan that is not level comes from the last level one, also when that was before the map moved.
TEST(MapperFollows, ATiltedScanAfterTheMapHasMovedIsReportedInTheNewMap) {
  const Drive drive = DriveRound();
  MapperOptions options;
  options.filter.particles = 20;
  Mapper mapper(options, drive.truth.front(), 1);
  ScanOutcome last;
  for (std::size_t i = 0; i < 40; ++i) last = mapper.Process(drive.scans[i], drive.odometry[i], SerialFor);
  const Pose2 T_new_old{3.0, -2.0, 0.5};
  std::vector<Pose2> path = mapper.BestPath();
  for (Pose2& pose : path) pose = T_new_old * pose;
  mapper.AdoptGrid(OccupancyGrid(mapper.grid().options()), path.size(), path);
  Scan tilted = *drive.scans[40];
  tilted.tilt_rad = 0.3;
  const ScanOutcome outcome = mapper.Process(std::make_shared<const Scan>(tilted), drive.odometry[39], SerialFor);
  EXPECT_LT((outcome.T_map_robot.translation() - (T_new_old * last.T_map_robot).translation()).norm(), 1e-6);
}

// A job has bent the path by what other robots have seen. The next large loop must not bend it back.
// And the next job must not take for a measurement what the last one has found.
TEST(MapperFollows, TheShapeOfAPathThatWasTakenIsKeptAndIsNoMeasurement) {
  const Drive drive = DriveRound();
  MapperOptions options;
  options.filter.particles = 20;
  Mapper mapper(options, drive.truth.front(), 1);
  for (std::size_t i = 0; i < 100; ++i) static_cast<void>(mapper.Process(drive.scans[i], drive.odometry[i], SerialFor));
  ASSERT_TRUE(mapper.Snapshot().relations.empty()) << "no place was seen again";
  std::vector<Pose2> path = mapper.BestPath();
  for (std::size_t k = 1; k < path.size(); ++k) {
    const Pose2 step = Between(mapper.BestPath()[k - 1], mapper.BestPath()[k]);
    path[k] = path[k - 1] * Pose2{step.x, step.y, step.theta + 0.0005};
  }
  const auto adopt = [&] { mapper.AdoptGrid(OccupancyGrid(mapper.grid().options()), path.size(), path); };
  adopt();
  const MapperSnapshot snapshot = mapper.Snapshot();
  EXPECT_EQ(snapshot.full_path, path);
  EXPECT_TRUE(snapshot.relations.empty());
  ASSERT_EQ(snapshot.steps.size() + 1, path.size()) << "the steps as they were measured";
  // The measured steps do not have the bend.
  double turned = 0.0;
  for (std::size_t k = 1; k < path.size(); ++k)
    turned += AngleDiff(Between(path[k - 1], path[k]).theta, snapshot.steps[k - 1].T_from_to.theta);
  EXPECT_GT(turned, 0.3 * 0.0005 * static_cast<double>(path.size()));
}

// What was driven since a version was made does not hang on its last keyframe alone: it must fit what was seen again.
TEST(MapperFollows, WhatWasDrivenSinceAVersionFitsWhatWasSeenAgain) {
  const Drive drive = DriveRound();
  MapperOptions options;
  options.filter.particles = 20;
  Mapper mapper(options, drive.truth.front(), 1);
  ScanOutcome last;
  std::size_t taken = 0;
  const auto drive_to = [&](std::size_t scan) {
    for (; taken < scan; ++taken) last = mapper.Process(drive.scans[taken], drive.odometry[taken], SerialFor);
  };
  drive_to(200);
  const std::size_t known = mapper.keyframe_count();
  drive_to(280);  // The second round has begun.
  std::vector<Pose2> path = mapper.BestPath();
  path.resize(known);
  for (std::size_t k = 1; k < known; ++k) {
    const Pose2 step = Between(mapper.BestPath()[k - 1], mapper.BestPath()[k]);
    path[k] = path[k - 1] * Pose2{step.x, step.y, step.theta + 0.0005};
  }
  ASSERT_TRUE(mapper.AdoptGrid(OccupancyGrid(mapper.grid().options()), known, path));
  for (std::size_t k = 0; k < known; ++k) EXPECT_EQ(mapper.BestPath()[k], path[k]) << k;
  drive_to(281);
  const MapperSnapshot snapshot = mapper.Snapshot();
  const auto begun = std::ranges::find(snapshot.keyframes, drive.scans[40]->stamp,
                                       [](const Keyframe& one) { return one.scan->stamp; });
  ASSERT_NE(begun, snapshot.keyframes.end());
  const Pose2 expected = snapshot.full_path.at(static_cast<std::size_t>(begun - snapshot.keyframes.begin())) *
                         Between(drive.truth[40], drive.truth[280]);
  EXPECT_LT((last.T_map_robot.translation() - expected.translation()).norm(), 0.05);
  EXPECT_TRUE(last.localized);
}

// Where a site goes back to an old map, a robot may lack thousands of keyframes in it.
TEST(MapperFollows, WhatAnAdoptedGridLacksIsDrawnSomeAtATimeAndBeforeACheckpoint) {
  const Drive drive = DriveRound();
  MapperOptions options;
  options.filter.particles = 5;
  Mapper mapper(options, drive.truth.front(), 1);
  for (std::size_t i = 0; i < 160; ++i) static_cast<void>(mapper.Process(drive.scans[i], drive.odometry[i], SerialFor));
  ASSERT_GT(mapper.keyframe_count(), 45U);
  ASSERT_TRUE(mapper.AdoptGrid(OccupancyGrid(mapper.grid().options()), 0));
  EXPECT_TRUE(mapper.draws_late());
  EXPECT_EQ(mapper.keyframes_drawn(), 0U);
  EXPECT_EQ(mapper.grid().chunk_count(), 0U);
  EXPECT_TRUE(mapper.DrawLate());
  EXPECT_EQ(mapper.keyframes_drawn(), 20U);
  StateWriter checkpoint;
  mapper.Save(checkpoint);
  EXPECT_FALSE(mapper.draws_late());
  EXPECT_EQ(mapper.keyframes_drawn(), mapper.keyframes_made());
  const MapperSnapshot snapshot = mapper.Snapshot();
  OccupancyGrid expected(mapper.grid().options());
  for (std::size_t k = 0; k < snapshot.keyframes.size(); ++k)
    if (snapshot.keyframes[k].localized) expected.Draw(*snapshot.keyframes[k].scan, snapshot.online_path[k]);
  EXPECT_EQ(ShareMissing(expected, mapper.grid()), 0.0);
  EXPECT_EQ(ShareMissing(mapper.grid(), expected), 0.0);
}

// What was seen again since the last large loop has corrected the pose at once. At the end it corrects the way to
// there, so that a job finds nothing more, and what is drawn lies along that path.
TEST(MapperFollows, AtTheEndThePathFitsAllThatWasSeenAgain) {
  const Drive drive = DriveRound();
  MapperOptions options;
  options.filter.particles = 20;
  Mapper mapper(options, drive.truth.front(), 1);
  for (std::size_t i = 0; i < drive.scans.size(); ++i)
    static_cast<void>(mapper.Process(drive.scans[i], drive.odometry[i], SerialFor));
  const auto most_apart = [](const std::vector<Pose2>& a, const std::vector<Pose2>& b) {
    double most_m = 0.0;
    for (std::size_t k = 0; k < a.size(); ++k)
      most_m = std::max(most_m, (a[k].translation() - b[k].translation()).norm());
    return most_m;
  };
  const MapperSnapshot before = mapper.Snapshot();
  ASSERT_FALSE(before.relations.empty());
  const std::vector<Pose2> smoothed = SmoothedPath(before);
  ASSERT_GT(most_apart(before.full_path, smoothed), 0.005);
  mapper.FinishMap();
  const MapperSnapshot after = mapper.Snapshot();
  EXPECT_LT(most_apart(after.full_path, smoothed), 0.001);
  EXPECT_LT(most_apart(after.full_path, SmoothedPath(after)), 0.001);
  EXPECT_EQ(after.full_path, after.online_path) << "the grid is drawn along it";
  EXPECT_EQ(mapper.BestPath().back(), after.full_path.back());
  options.pose_graph.enabled = false;
  Mapper sampled(options, drive.truth.front(), 1);
  for (std::size_t i = 0; i < drive.scans.size(); ++i)
    static_cast<void>(sampled.Process(drive.scans[i], drive.odometry[i], SerialFor));
  const std::vector<Pose2> path = sampled.BestPath();
  sampled.FinishMap();
  EXPECT_EQ(sampled.BestPath(), path) << "nobody wants it fitted";
}

// A path that does not belong to the keyframes is not taken.
TEST(MapperFollows, APathOfAnotherLengthDoesNotMoveTheEstimator) {
  const Drive drive = DriveRound();
  MapperOptions options;
  options.filter.particles = 20;
  Mapper mapper(options, drive.truth.front(), 1);
  for (std::size_t i = 0; i < 40; ++i) static_cast<void>(mapper.Process(drive.scans[i], drive.odometry[i], SerialFor));
  const std::vector<Pose2> before = mapper.BestPath();
  const std::vector<Pose2> short_path(before.size() - 1), long_path(before.size() + 1);
  mapper.AdoptGrid(OccupancyGrid(mapper.grid().options()), before.size(), short_path);
  mapper.AdoptGrid(OccupancyGrid(mapper.grid().options()), before.size(), long_path);
  EXPECT_FALSE(mapper.AdoptGrid(OccupancyGrid(mapper.grid().options()), long_path.size(), short_path));
  EXPECT_EQ(mapper.BestPath(), before);
}

}  // namespace
}  // namespace cairn::slam
