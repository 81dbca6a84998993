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

// From half way on 0.15 m beside the truth.
std::vector<Pose2> BrokenPath() {
  std::vector<Pose2> path = TruePath();
  for (std::size_t k = path.size() / 2; k < path.size(); ++k) path[k].x += 0.15;
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
  const auto map = SmoothMap(Snapshot(BrokenPath(), TruePath()), {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->path, TruePath());
  EXPECT_LT(map->after.mean_m2(), map->before.mean_m2());
  OccupancyGrid expected{GridOptions{}};
  for (int k = 0; k < kLooks; ++k) expected.Draw(RoomScan(4 * k), TruePose(4 * k));
  ASSERT_EQ(map->grid.chunks().size(), expected.chunks().size());
  for (const auto& [key, chunk] : expected.chunks()) EXPECT_EQ(map->grid.chunks().at(key)->log_odds, chunk->log_odds);
}

// A robot that saw no place twice: the best particle's path is one sample, worse than what the robot was told.
TEST(SmoothedMap, KeepsTheOnlinePathWhereTheScansAgreeBetterWithIt) {
  const auto map = SmoothMap(Snapshot(TruePath(), BrokenPath()), {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->path, TruePath());
  EXPECT_EQ(map->after.mean_m2(), map->before.mean_m2());
}

TEST(SmoothedMap, IsTheBestParticlesInAnyCaseWhereTheThesisIsAskedFor) {
  MapperSnapshot snapshot = Snapshot(TruePath(), BrokenPath());
  snapshot.pose_graph.enabled = false;
  const auto map = SmoothMap(snapshot, {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->path, BrokenPath());
  EXPECT_GT(map->after.mean_m2(), map->before.mean_m2());
}

TEST(SmoothedMap, AFittedPathIsNotOverruled) {
  MapperSnapshot snapshot = Snapshot(TruePath(), BrokenPath());
  const Eigen::Matrix3d tight = 1e-6 * Eigen::Matrix3d::Identity();
  for (std::size_t k = 1; k < kLooks; ++k)
    snapshot.relations.push_back({k - 1, k, Between(BrokenPath()[k - 1], BrokenPath()[k]), tight, false});
  const auto map = SmoothMap(snapshot, {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_NEAR(map->path.back().x, BrokenPath().back().x, 1e-6);
}

TEST(SmoothedMap, EndsAtOnceWhenToldTo) {
  int asked = 0;
  EXPECT_FALSE(SmoothMap(Snapshot(TruePath(), TruePath()), {}, [&asked] { return ++asked < 30; }));
  EXPECT_EQ(asked, 30);
  asked = 0;
  EXPECT_TRUE(SmoothMap(Snapshot(TruePath(), TruePath()), {}, [&asked] { return ++asked > 0; }));
  EXPECT_EQ(asked, kSmoothingStepsPerKeyframe * kLooks);
}

TEST(SmoothedMap, OfNothingIsEmpty) {
  const auto map = SmoothMap({}, {}, kGoOn);
  ASSERT_TRUE(map);
  EXPECT_TRUE(map->path.empty());
  EXPECT_TRUE(map->grid.chunks().empty());
}

}  // namespace
}  // namespace cairn::slam
