#include "server/slam/smoothing/drawn_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <set>

#include "tests/server/support/room_world.h"

namespace cairn::slam {
namespace {

using server::testing::RoomScan;
using server::testing::TruePose;

constexpr std::size_t kLookCount = 20;
constexpr double kDrawnCellM = 0.02;
const auto kDrawAll = [] { return true; };
using Drawn = std::shared_ptr<const DrawnMap>;

// Chunks of 2.56 m and rays of at most 2 m: a scan reaches some of the chunks only.
GridOptions FineGrid(GridModel model = GridModel::kProbabilistic) {
  GridOptions options;
  options.model = model;
  options.resolution_m = kDrawnCellM;
  options.max_ray_m = 2.0;
  return options;
}

std::vector<Pose2> WayRoundTheBox() {
  std::vector<Pose2> path;
  for (std::size_t k = 0; k < kLookCount; ++k) path.push_back(TruePose(4 * static_cast<int>(k)));
  return path;
}

MapperSnapshot Looks() {
  MapperSnapshot snapshot;
  for (std::size_t k = 0; k < kLookCount; ++k) {
    const int step = 4 * static_cast<int>(k);
    snapshot.keyframes.push_back({std::make_shared<const Scan>(RoomScan(step)), TruePose(step)});
    snapshot.numbers.push_back(k);
  }
  return snapshot;
}

// The first keyframes.
MapperSnapshot FirstOf(MapperSnapshot snapshot, std::size_t count) {
  snapshot.keyframes.resize(count);
  snapshot.numbers.resize(count);
  return snapshot;
}

Drawn DrawAgain(const MapperSnapshot& snapshot, const std::vector<Pose2>& path, const Drawn& before,
                const GridOptions& options = FineGrid()) {
  const std::array earlier{before};
  return DrawMap(snapshot, path, options, earlier, kDrawAll);
}

Drawn DrawAnew(const MapperSnapshot& snapshot, const std::vector<Pose2>& path,
               const GridOptions& options = FineGrid()) {
  return DrawMap(snapshot, path, options, {}, kDrawAll);
}

void ExpectSame(const DrawnMap& one, const DrawnMap& other) {
  ASSERT_EQ(one.chunks.size(), other.chunks.size());
  for (const auto& [key, chunk] : one.chunks) {
    ASSERT_TRUE(other.chunks.contains(key)) << key.x << " " << key.y;
    EXPECT_TRUE(chunk->log_odds == other.chunks.at(key)->log_odds) << "chunk " << key.x << " " << key.y;
  }
  ASSERT_EQ(one.keyframes.size(), other.keyframes.size());
  for (std::size_t i = 0; i < one.keyframes.size(); ++i) {
    EXPECT_EQ(one.keyframes[i].number, other.keyframes[i].number);
    EXPECT_EQ(one.keyframes[i].T_map_robot, other.keyframes[i].T_map_robot);
    EXPECT_TRUE(one.keyframes[i].drawn_in == other.keyframes[i].drawn_in) << i;
    EXPECT_TRUE(one.keyframes[i].compared_with == other.keyframes[i].compared_with) << i;
    EXPECT_EQ(one.keyframes[i].disagreement.mean_m2(), other.keyframes[i].disagreement.mean_m2()) << i;
  }
  EXPECT_EQ(one.Sum().mean_m2(), other.Sum().mean_m2());
}

TEST(DrawnMap, IsWhatAGridShowsOntoWhichAllScansAreDrawn) {
  const Drawn drawn = DrawAnew(Looks(), WayRoundTheBox());
  OccupancyGrid grid(FineGrid());
  Disagreement disagreement;
  for (std::size_t k = 0; k < kLookCount; ++k) grid.Draw(RoomScan(4 * static_cast<int>(k)), WayRoundTheBox()[k]);
  for (std::size_t k = 0; k < kLookCount; ++k)
    disagreement.Add(RoomScan(4 * static_cast<int>(k)), WayRoundTheBox()[k], grid);
  ASSERT_EQ(drawn->chunks.size(), grid.chunk_count());
  grid.ForEachChunk([&](const ChunkKey& key, const GridChunk& chunk) {
    EXPECT_TRUE(drawn->chunks.at(key)->log_odds == chunk.log_odds);
  });
  EXPECT_NEAR(drawn->Sum().mean_m2(), disagreement.mean_m2(), 1e-12);
  EXPECT_EQ(drawn->drawn_anew, kLookCount);
  EXPECT_GT(drawn->Bytes(), drawn->chunks.size() * sizeof(GridChunk));
}

TEST(DrawnMap, WhereOneKeyframeHasMovedOnlyTheChunksThatItReachesAreDrawnAgain) {
  constexpr std::size_t kMoved = 17;
  const Drawn first = DrawAnew(Looks(), WayRoundTheBox());
  std::vector<Pose2> path = WayRoundTheBox();
  path[kMoved].x += 0.15;
  const Drawn second = DrawAgain(Looks(), path, first);
  EXPECT_EQ(second->drawn_anew, 1U);
  ExpectSame(*second, *DrawAnew(Looks(), path));

  const auto& before = first->keyframes[kMoved].drawn_in;
  const auto& now = second->keyframes[kMoved].drawn_in;
  std::set<ChunkKey> touched(before.begin(), before.end());
  touched.insert(now.begin(), now.end());
  std::size_t untouched = 0;
  for (const auto& [key, chunk] : second->chunks) {
    if (touched.contains(key)) continue;
    ++untouched;
    EXPECT_EQ(chunk, first->chunks.at(key)) << key.x << " " << key.y;
  }
  EXPECT_GE(untouched, 2U);
  EXPECT_LT(untouched, second->chunks.size());
}

TEST(DrawnMap, KeyframesAtTheEndAreDrawnOntoWhatIsThere) {
  const std::vector<Pose2> path = WayRoundTheBox();
  const Drawn first = DrawAnew(FirstOf(Looks(), 16), path);
  const Drawn second = DrawAgain(Looks(), path, first);
  EXPECT_EQ(second->drawn_anew, kLookCount - 16);
  ExpectSame(*second, *DrawAnew(Looks(), path));
  // What others have of the first drawing has not changed.
  ExpectSame(*first, *DrawAnew(FirstOf(Looks(), 16), path));
}

TEST(DrawnMap, KeyframesThatAreGoneAndThoseThatComeBetweenAreSeen) {
  MapperSnapshot before = Looks();
  before.keyframes[9].localized = false;
  const Drawn first = DrawAnew(before, WayRoundTheBox());
  EXPECT_EQ(first->keyframes.size(), kLookCount - 1);
  MapperSnapshot after = Looks();
  std::vector<Pose2> path = WayRoundTheBox();
  after.keyframes.erase(after.keyframes.begin() + 3);
  after.numbers.erase(after.numbers.begin() + 3);
  path.erase(path.begin() + 3);
  const Drawn second = DrawAgain(after, path, first);
  EXPECT_EQ(second->drawn_anew, 1U);
  ExpectSame(*second, *DrawAnew(after, path));
  // And one whose place is no longer known.
  after.keyframes[12].localized = false;
  const Drawn third = DrawAgain(after, path, second);
  EXPECT_EQ(third->drawn_anew, 0U);
  ExpectSame(*third, *DrawAnew(after, path));
}

// A fifth of a cell is 4 mm, and rays are 2 m long.
TEST(DrawnMap, SmallMovesCountFromWhereAKeyframeWasDrawn) {
  const auto moved = [](double by_m, double by_rad) {
    std::vector<Pose2> path = WayRoundTheBox();
    for (Pose2& pose : path) pose = {pose.x + by_m, pose.y, WrapAngle(pose.theta + by_rad)};
    return path;
  };
  Drawn drawn = DrawAnew(Looks(), WayRoundTheBox());
  const OccupancyGrid::Chunks first = drawn->chunks;
  for (const auto& [by_m, by_rad] : {std::pair{0.0014, 0.0}, {0.0028, 0.0}, {0.0, 0.001}, {0.0018, -0.001}}) {
    drawn = DrawAgain(Looks(), moved(by_m, by_rad), drawn);
    EXPECT_EQ(drawn->drawn_anew, 0U) << by_m << " " << by_rad;
    EXPECT_EQ(drawn->chunks, first);
    EXPECT_EQ(drawn->keyframes[5].T_map_robot, WayRoundTheBox()[5]);
  }
  const Drawn shifted = DrawAgain(Looks(), moved(0.0042, 0.0), drawn);
  EXPECT_EQ(shifted->drawn_anew, kLookCount);
  ExpectSame(*shifted, *DrawAnew(Looks(), moved(0.0042, 0.0)));
  EXPECT_EQ(DrawAgain(Looks(), moved(0.0, 0.003), drawn)->drawn_anew, kLookCount);
}

// Cells are clamped, and in some models the last scan decides: the order of the scans has to stay.
TEST(DrawnMap, AfterManyChangesItIsStillWhatIsDrawnAnew) {
  std::mt19937 random(7);
  for (const GridModel model : {GridModel::kProbabilistic, GridModel::kDegrading, GridModel::kTriangular}) {
    const GridOptions options = FineGrid(model);
    std::vector<Pose2> path = WayRoundTheBox();
    Drawn drawn = DrawAnew(FirstOf(Looks(), 14), path, options);
    for (std::size_t count = 15; count <= kLookCount; ++count) {
      for (Pose2& pose : path) pose.x += 0.0003;
      for (int i = 0; i < 2; ++i) path[random() % count].y += 0.05;
      const MapperSnapshot snapshot = FirstOf(Looks(), count);
      drawn = DrawAgain(snapshot, path, drawn, options);
      ASSERT_EQ(drawn->keyframes.size(), count);
      EXPECT_LT(drawn->drawn_anew, count);
      std::vector<Pose2> drawn_along;
      for (std::size_t k = 0; k < count; ++k) {
        drawn_along.push_back(drawn->keyframes[k].T_map_robot);
        EXPECT_LT((drawn_along[k].translation() - path[k].translation()).norm(), 0.2 * kDrawnCellM + 1e-12);
      }
      ExpectSame(*drawn, *DrawAnew(snapshot, drawn_along, options));
    }
    if (model == GridModel::kProbabilistic) {  // So there was something to compare.
      EXPECT_GT(drawn->Sum().mean_m2(), 0.0);
    }
  }
}

TEST(DrawnMap, AnotherScanWithTheSameNumberIsNotTakenForDrawn) {
  const Drawn first = DrawAnew(Looks(), WayRoundTheBox());
  MapperSnapshot other = Looks();
  other.keyframes[6].scan = std::make_shared<const Scan>(RoomScan(61));
  const Drawn second = DrawAgain(other, WayRoundTheBox(), first);
  EXPECT_EQ(second->drawn_anew, 1U);
  ExpectSame(*second, *DrawAnew(other, WayRoundTheBox()));
}

TEST(DrawnMap, ADrawingWithOtherOptionsIsNotContinued) {
  const Drawn coarse = DrawAnew(Looks(), WayRoundTheBox(), GridOptions{});
  EXPECT_EQ(DrawAgain(Looks(), WayRoundTheBox(), coarse)->drawn_anew, kLookCount);
  EXPECT_EQ(DrawAgain(Looks(), WayRoundTheBox(), nullptr)->drawn_anew, kLookCount);
}

TEST(DrawnMap, TheEarlierDrawingWithMostInCommonIsContinued) {
  const std::vector<Pose2> way = WayRoundTheBox();
  std::vector<Pose2> path = way;
  for (std::size_t k = 18; k < kLookCount; ++k) path[k].x += 0.1;
  const std::array earlier{DrawAnew(Looks(), path), DrawAnew(Looks(), way)};
  EXPECT_EQ(DrawMap(Looks(), way, FineGrid(), earlier, kDrawAll)->drawn_anew, 0U);
  EXPECT_EQ(DrawMap(Looks(), path, FineGrid(), earlier, kDrawAll)->drawn_anew, 0U);
}

TEST(DrawnMap, EndsWhenToldTo) {
  for (const int most : {5, 25}) {
    int asked = 0;
    EXPECT_EQ(DrawMap(Looks(), WayRoundTheBox(), FineGrid(), {}, [&] { return ++asked < most; }), nullptr);
    EXPECT_EQ(asked, most);
  }
}

}  // namespace
}  // namespace cairn::slam
