#include "server/slam/smoothing/smoothed_map.h"

#include <gtest/gtest.h>

#include "tests/server/support/room_world.h"

namespace cairn::slam {
namespace {

using server::testing::RoomScan;
using server::testing::TruePose;

constexpr int kLooks = 20;

std::vector<Pose2> TruePath() {
  std::vector<Pose2> path;
  for (int k = 0; k < kLooks; ++k) path.push_back(TruePose(4 * k));
  return path;
}

// From half way on beside the truth.
std::vector<Pose2> BrokenPath(double beside_m = 0.15) {
  std::vector<Pose2> path = TruePath();
  for (std::size_t k = path.size() / 2; k < path.size(); ++k) path[k].x += beside_m;
  return path;
}

MapperSnapshot Snapshot(std::vector<Pose2> online, std::vector<Pose2> full) {
  MapperSnapshot snapshot;
  for (int k = 0; k < kLooks; ++k)
    snapshot.keyframes.push_back({std::make_shared<const Scan>(RoomScan(4 * k)), TruePose(4 * k)});
  snapshot.online_path = std::move(online);
  snapshot.full_path = std::move(full);
  return snapshot;
}

const auto kGoOn = [] { return true; };

TEST(SmoothedMap, IsDrawnAlongTheSmoothedPathAndSaysHowMuchBetterItFits) {
  auto map = SmoothMap(Snapshot(BrokenPath(), TruePath()), {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->path, TruePath());
  EXPECT_LT(map->after.mean_m2(), map->before.mean_m2());
  OccupancyGrid expected{GridOptions{}};
  for (int k = 0; k < kLooks; ++k) expected.Draw(RoomScan(4 * k), TruePose(4 * k));
  const OccupancyGrid::Chunks drawn = map->grid.Share();
  ASSERT_EQ(drawn.size(), expected.chunk_count());
  expected.ForEachChunk(
      [&](const ChunkKey& key, const GridChunk& chunk) { EXPECT_EQ(drawn.at(key)->log_odds, chunk.log_odds); });
}

TEST(SmoothedMap, AKeyframeThatIsNotLocalizedIsDrawnIntoNoMap) {
  MapperSnapshot snapshot = Snapshot(TruePath(), TruePath());
  // Nobody knows where this one was taken: it would be drawn far away from everything else.
  snapshot.keyframes[7].localized = false;
  snapshot.online_path[7] = snapshot.full_path[7] = {300.0, 0.0, 0.0};
  const auto map = SmoothMap(snapshot, {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->path.size(), snapshot.keyframes.size());
  OccupancyGrid expected{GridOptions{}};
  for (int k = 0; k < kLooks; ++k) {
    if (k != 7) expected.Draw(RoomScan(4 * k), TruePose(4 * k));
  }
  EXPECT_EQ(map->grid.chunk_count(), expected.chunk_count());
}

// A robot that saw no place twice: the best particle's path is one sample, worse than what the robot was told.
TEST(SmoothedMap, KeepsTheOnlinePathWhereTheScansAgreeBetterWithIt) {
  const auto map = SmoothMap(Snapshot(TruePath(), BrokenPath()), {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->path, TruePath());
  EXPECT_EQ(map->after.mean_m2(), map->before.mean_m2());
}

// The last scan alone is wrong. It agrees with the map in which it is drawn itself, so that the maps of both paths
// seemed equally good.
TEST(SmoothedMap, KeepsTheOnlinePathWhereOnlyTheWrongScanItselfAgreesWithTheOther) {
  std::vector<Pose2> sample = TruePath();
  for (std::size_t k = 1; k < sample.size(); k += 2) sample[k].y += 0.04;
  const auto map = SmoothMap(Snapshot(TruePath(), sample), {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->path, TruePath());
}

// Of two paths that are as good, the mean of the particles is nearer to the truth than one of them.
TEST(SmoothedMap, KeepsTheOnlinePathWhereTheOtherIsNotClearlyBetter) {
  std::vector<Pose2> online = TruePath();
  online[3].x += 0.02;
  const auto map = SmoothMap(Snapshot(online, TruePath()), {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->path, online);
}

TEST(SmoothedMap, IsTheBestParticlesInAnyCaseWhereTheThesisIsAskedFor) {
  MapperSnapshot snapshot = Snapshot(TruePath(), BrokenPath());
  snapshot.pose_graph.enabled = false;
  const auto map = SmoothMap(snapshot, {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->path, BrokenPath());
  EXPECT_GT(map->after.mean_m2(), map->before.mean_m2());
}

// The path online, its steps, and this many loops, all alike, that say that it is the other one.
MapperSnapshot SnapshotWithLoops(const std::vector<Pose2>& online, const std::vector<Pose2>& other, int loops) {
  MapperSnapshot snapshot = Snapshot(online, online);
  const Eigen::Matrix3d loose = 1e-3 * Eigen::Matrix3d::Identity(), tight = 1e-6 * Eigen::Matrix3d::Identity();
  for (std::size_t k = 1; k < kLooks; ++k)
    snapshot.relations.push_back({k - 1, k, Between(online[k - 1], online[k]), loose, false});
  for (int i = 0; i < loops; ++i)
    snapshot.relations.push_back({0, kLooks - 1, Between(other.front(), other.back()), tight, true});
  return snapshot;
}

// One place seen again, half a metre beside where it is: nothing but the scans contradicts it.
TEST(SmoothedMap, AWrongLoopWithFewOthersDoesNotBendThePath) {
  const MapperSnapshot snapshot = SnapshotWithLoops(TruePath(), BrokenPath(0.5), 1);
  ASSERT_GT(std::abs(SmoothedPath(snapshot).back().x - TruePath().back().x), 0.4);
  int asked = 0;
  const auto map = SmoothMap(snapshot, {}, [&asked] { return ++asked > 0; });
  ASSERT_TRUE(map);
  EXPECT_TRUE(map->path == TruePath());
  EXPECT_LE(asked, static_cast<int>(SmoothingSteps(snapshot)));
}

TEST(SmoothedMap, ARightLoopIsTakenWhereItIsTheOnlyOne) {
  const auto map = SmoothMap(SnapshotWithLoops(BrokenPath(), TruePath(), 1), {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_NEAR(map->path.back().x, TruePath().back().x, 0.01);
}

TEST(SmoothedMap, APathFittedToManyLoopsIsNotOverruled) {
  const auto map = SmoothMap(SnapshotWithLoops(TruePath(), BrokenPath(0.5), 11), {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_NEAR(map->path.back().x, BrokenPath(0.5).back().x, 0.01);
}

TEST(SmoothedMap, EndsAtOnceWhenToldTo) {
  int asked = 0;
  EXPECT_FALSE(SmoothMap(Snapshot(TruePath(), TruePath()), {}, [&asked] { return ++asked < 30; }));
  EXPECT_EQ(asked, 30);
  asked = 0;
  EXPECT_TRUE(SmoothMap(Snapshot(TruePath(), TruePath()), {}, [&asked] { return ++asked > 0; }));
  EXPECT_LE(asked, static_cast<int>(SmoothingSteps(Snapshot(TruePath(), TruePath()))));
  asked = 0;
  EXPECT_TRUE(SmoothMap(Snapshot(BrokenPath(), TruePath()), {}, [&asked] { return ++asked > 0; }));
  EXPECT_EQ(asked, static_cast<int>(SmoothingSteps(Snapshot(BrokenPath(), TruePath()))));
}

// The fit of a long path takes minutes and draws nothing meanwhile: it needs its own way to be told to end.
TEST(SmoothedMap, TheFitCanBeEndedToo) {
  auto snapshot = Snapshot(BrokenPath(), BrokenPath());
  for (std::size_t k = 1; k < kLooks; ++k) {
    snapshot.relations.push_back(
        {k - 1, k, TruePath()[k - 1].Inverse() * TruePath()[k], Eigen::Matrix3d::Identity() * 1e-4, false});
  }
  int drawn = 0;
  const auto next = [&drawn] { return ++drawn > 0; };
  EXPECT_FALSE(SmoothMap(snapshot, {}, next, [] { return false; }));
  EXPECT_EQ(drawn, 2 * kLooks);  // The online map was drawn and compared, the smoothed one was not begun.
  EXPECT_TRUE(SmoothMap(snapshot, {}, next, kGoOn));
}

TEST(SmoothedMap, WhatAnEarlierJobHasDrawnIsNotDrawnAgain) {
  DrawnMaps drawn;
  MapperSnapshot snapshot = Snapshot(BrokenPath(), TruePath());
  const auto first = SmoothMap(snapshot, {}, kGoOn, {}, &drawn);
  ASSERT_TRUE(first && drawn.online && drawn.smoothed);
  EXPECT_EQ(drawn.smoothed->drawn_anew, static_cast<std::size_t>(kLooks));
  const auto chunks = drawn.smoothed->chunks;
  const auto second = SmoothMap(snapshot, {}, kGoOn, {}, &drawn);
  ASSERT_TRUE(second);
  EXPECT_EQ(drawn.online->drawn_anew + drawn.smoothed->drawn_anew, 0U);
  EXPECT_EQ(drawn.smoothed->chunks, chunks);
  EXPECT_EQ(second->before.mean_m2(), first->before.mean_m2());
  EXPECT_EQ(second->after.mean_m2(), first->after.mean_m2());
  // The result was enabled: the robot's own path is now what was the smoothed one.
  snapshot.online_path = TruePath();
  ASSERT_TRUE(MapAlong(snapshot, TruePath(), {}, kGoOn, &drawn));
  EXPECT_EQ(drawn.online->drawn_anew, 0U);
  EXPECT_EQ(drawn.online->chunks, chunks);
  // A job that is cancelled forgets nothing.
  EXPECT_FALSE(MapAlong(
      snapshot, BrokenPath(), {}, [] { return false; }, &drawn));
  EXPECT_EQ(drawn.smoothed->chunks, chunks);
}

TEST(SmoothedMap, OfNothingIsEmpty) {
  const auto map = SmoothMap({}, {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_TRUE(map->path.empty());
  EXPECT_EQ(map->grid.chunk_count(), 0U);
}

}  // namespace
}  // namespace cairn::slam
