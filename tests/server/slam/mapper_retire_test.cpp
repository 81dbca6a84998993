// The estimator gives up keyframes that show nothing new. A robot drives round a block eight times.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "server/slam/mapper.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "server/slam/state/archive.h"
#include "tests/server/slam/ring_drive.h"

namespace cairn::slam {
namespace {

using test::Drive;
using test::DriveRound;
using test::ShareMissing;

const Drive& Rounds() {
  static const Drive drive = DriveRound(8);
  return drive;
}

MapperOptions Options(bool retire) {
  MapperOptions options;
  options.filter.particles = 20;
  options.retire.enabled = retire;
  options.retire.from_keyframes = 400;
  options.retire.recent_keyframes = 200;
  options.retire.visits = 2;
  return options;
}

struct Course {
  explicit Course(const MapperOptions& options) : mapper(options, Rounds().truth.front(), 1) {}
  ScanOutcome Take(std::size_t scan) {
    return mapper.Process(Rounds().scans[scan], Rounds().odometry[scan], SerialFor);
  }
  void TakeAll(std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) {
      const ScanOutcome outcome = Take(i);
      const double error_m = (outcome.T_map_robot.translation() - Rounds().truth[i].translation()).norm();
      worst_m = std::max(worst_m, error_m);
      lost += outcome.localized ? 0 : 1;
    }
  }
  Mapper mapper;
  double worst_m = 0.0;
  int lost = 0;
};

double WorstError(const Mapper& mapper) {
  const MapperSnapshot snapshot = mapper.Snapshot();
  const Trajectory smoothed = snapshot.TrajectoryAlong(SmoothedPath(snapshot));
  EXPECT_EQ(smoothed.size(), Rounds().scans.size());
  double worst_m = 0.0;
  for (std::size_t i = 0; i < smoothed.size(); ++i) {
    EXPECT_EQ(smoothed[i].stamp, Rounds().scans[i]->stamp);
    worst_m = std::max(worst_m, (smoothed[i].T_map_robot.translation() - Rounds().truth[i].translation()).norm());
  }
  return worst_m;
}

TEST(MapperRetires, ItKeepsFewerKeyframesAndIsAsExact) {
  Course all(Options(false)), few(Options(true));
  const std::size_t size = Rounds().scans.size();
  all.TakeAll(0, size);
  few.TakeAll(0, size);
  EXPECT_EQ(few.mapper.keyframes_made(), all.mapper.keyframe_count());
  EXPECT_LT(few.mapper.keyframe_count(), 0.75 * static_cast<double>(all.mapper.keyframe_count()));
  EXPECT_EQ(few.lost, 0);
  EXPECT_LT(few.worst_m, all.worst_m + 0.05);
  EXPECT_LT(WorstError(few.mapper), WorstError(all.mapper) + 0.02);
  EXPECT_LT(ShareMissing(all.mapper.grid(), few.mapper.grid()), 0.02);
  EXPECT_EQ(few.mapper.landmarks().size() > 0, all.mapper.landmarks().size() > 0);
}

TEST(MapperRetires, StoppingChangesNothing) {
  Course course(Options(true));
  const std::size_t size = Rounds().scans.size();
  std::size_t half = 0;
  while (course.mapper.keyframe_count() == course.mapper.keyframes_made() && half < size)
    course.TakeAll(half, half + 1), ++half;
  ASSERT_LT(half + 100, size) << "no keyframe was retired";
  StateWriter writer;
  course.mapper.Save(writer);
  const std::string bytes = writer.Bytes();
  StateReader reader(bytes);
  Course stopped(Options(true));
  stopped.mapper.Load(reader);
  ASSERT_TRUE(reader.ok()) << reader.failed();
  for (std::size_t i = half; i < size; ++i) ASSERT_EQ(stopped.Take(i).T_map_robot, course.Take(i).T_map_robot) << i;
  StateWriter one, other;
  course.mapper.Save(one);
  stopped.mapper.Save(other);
  EXPECT_TRUE(one.Bytes() == other.Bytes());
}

// A job took its snapshot before some of these keyframes were retired.
TEST(MapperRetires, APathFromBeforeIsFollowed) {
  Course course(Options(true));
  const std::size_t size = Rounds().scans.size();
  course.TakeAll(0, 390);
  const MapperSnapshot snapshot = course.mapper.Snapshot();
  ASSERT_EQ(snapshot.keyframes.size(), snapshot.made());
  const Pose2 T_new_old{3.0, -2.0, 0.5};
  std::vector<Pose2> path = snapshot.full_path;
  for (Pose2& pose : path) pose = T_new_old * pose;
  course.TakeAll(390, size);
  ASSERT_LT(course.mapper.keyframe_count(), course.mapper.keyframes_made());
  const std::vector<Pose2> before = course.mapper.BestPath();
  course.mapper.AdoptGrid(OccupancyGrid(course.mapper.grid().options()), snapshot.made(), path, snapshot.numbers);
  const std::vector<Pose2> after = course.mapper.BestPath();
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t k = 0; k < after.size(); ++k)
    ASSERT_LT((after[k].translation() - (T_new_old * before[k]).translation()).norm(), 0.2) << k;

  // And one from afterwards, which has not all of them.
  const MapperSnapshot later = course.mapper.Snapshot();
  ASSERT_EQ(later.numbers, course.mapper.keyframe_numbers());
  course.mapper.AdoptGrid(OccupancyGrid(course.mapper.grid().options()), later.made(), before, later.numbers);
  EXPECT_LT((course.mapper.BestPath().back().translation() - before.back().translation()).norm(), 1e-6);

  // A path that lacks a keyframe is not taken.
  std::vector<std::uint64_t> fewer(later.numbers.begin() + 1, later.numbers.end());
  const std::vector<Pose2> shorter(after.begin() + 1, after.end());
  course.mapper.AdoptGrid(OccupancyGrid(course.mapper.grid().options()), later.made(), shorter, fewer);
  EXPECT_LT((course.mapper.BestPath().back().translation() - before.back().translation()).norm(), 1e-6);
}

// The path is corrected, and the map drawn again from what is kept.
TEST(MapperRetires, TheMapIsDrawnAgainFromWhatIsKept) {
  Course course(Options(true));
  course.TakeAll(0, Rounds().scans.size());
  const MapperSnapshot snapshot = course.mapper.Snapshot();
  const auto map = SmoothMap(
      snapshot, course.mapper.grid().options(), [] { return true; }, [] { return true; });
  ASSERT_TRUE(map);
  EXPECT_LT(ShareMissing(course.mapper.grid(), map->grid), 0.03);
}

}  // namespace
}  // namespace cairn::slam
