#include "server/slam/grid/occupancy_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "server/slam/grid/grid_image.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::Look;
using test::Room;

TEST(OccupancyGrid, WallsAreOccupiedFreeSpaceFreeBeyondUnknown) {
  OccupancyGrid grid{GridOptions{}};
  for (int i = 0; i < 5; ++i) grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser(720)), {});
  EXPECT_GT(grid.OccupancyAt({3.01, 0.0}), 80);
  EXPECT_LT(grid.OccupancyAt({1.5, 0.5}), 20);
  EXPECT_EQ(grid.OccupancyAt({4.0, 0.0}), kUnknownCell);
}

TEST(OccupancyGrid, OnlyTheChunksThatAreWantedChange) {
  const Scan scan = Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser(720));
  OccupancyGrid all{GridOptions{}}, some{GridOptions{}};
  all.Draw(scan, {});
  std::vector<ChunkKey> asked;
  some.Draw(scan, {}, [&asked](const ChunkKey& key) {
    asked.push_back(key);
    return key.x == 0;
  });
  const OccupancyGrid::Chunks drawn = all.Share(), wanted = some.Share();
  ASSERT_EQ(asked.size(), 4U);  // Those round the origin.
  EXPECT_EQ(drawn.size(), 4U);
  EXPECT_EQ(wanted.size(), 2U);
  for (const auto& [key, chunk] : wanted) {
    EXPECT_EQ(key.x, 0);
    EXPECT_TRUE(chunk->log_odds == drawn.at(key)->log_odds);
  }
  EXPECT_EQ(some.TakeChange().size(), 2U);
}

TEST(OccupancyGrid, DeterministicCellsFollowTheLastScan) {
  GridOptions options;
  options.model = GridModel::kDeterministic;
  OccupancyGrid grid(options);
  for (int i = 0; i < 5; ++i) grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser(720)), {});
  grid.Draw(Look(Room(-5, -2, 10, 4), {}, test::FullTurnLaser(720)), {});
  EXPECT_LT(grid.OccupancyAt({3.01, 0.0}), 20);
}

// Thesis A 3.7: one ray through an occupied cell only reduces its occupancy by one level, while one hit makes
// a cell occupied at once.
TEST(OccupancyGrid, DegradingCellsAreHardToFree) {
  GridOptions options;
  options.model = GridModel::kDegrading;
  OccupancyGrid grid(options);
  const Scan near = Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser(720)),
             far = Look(Room(-5, -2, 10, 4), {}, test::FullTurnLaser(720));
  grid.Draw(near, {});
  const int occupied = grid.OccupancyAt({3.01, 0.0});
  EXPECT_GT(occupied, 95);  // By one hit.
  EXPECT_LT(grid.OccupancyAt({1.5, 0.5}), 5);
  grid.Draw(far, {});
  EXPECT_LT(grid.OccupancyAt({3.01, 0.0}), occupied);
  EXPECT_GT(grid.OccupancyAt({3.01, 0.0}), 90);
  int misses = 1;
  for (; grid.OccupancyAt({3.01, 0.0}) >= 50 && misses < 100; ++misses) grid.Draw(far, {});
  EXPECT_GT(misses, 8);
  EXPECT_LT(misses, 20);
  EXPECT_LT(grid.OccupancyAt({3.01, 0.0}), 5);  // The cell is free at once.
  grid.Draw(near, {});
  EXPECT_GT(grid.OccupancyAt({3.01, 0.0}), 95);
}

// Thesis A 3.7: the density of a hit falls linearly with the distance, along the beam and across it.
TEST(OccupancyGrid, ATriangularHitSpreadsOverTheCellsAround) {
  GridOptions options;
  options.model = GridModel::kTriangular;
  options.hit_spread_m = 0.15;  // Three cells.
  OccupancyGrid grid(options);
  Scan scan;
  scan.angle_step_rad = 0.001;
  scan.range_max_m = 30.0;
  scan.ranges_m = {2.0F};
  for (int i = 0; i < 3; ++i) grid.Draw(scan, {0.001, 0.001, 0.0});
  const int hit = grid.OccupancyAt({2.001, 0.001});
  for (const Eigen::Vector2d& along : {Eigen::Vector2d(0.05, 0.0), Eigen::Vector2d(-0.05, 0.0),
                                       Eigen::Vector2d(0.0, 0.05), Eigen::Vector2d(0.0, -0.05)}) {
    const Eigen::Vector2d p(2.001, 0.001);
    const int beside = grid.OccupancyAt(p + along), next = grid.OccupancyAt(p + 2.0 * along);
    EXPECT_GT(hit, beside + 3) << along.transpose();
    EXPECT_GT(beside, next + 3) << along.transpose();
    EXPECT_GT(next, 50) << along.transpose();
    if (along.x() < 0.0) continue;
    EXPECT_EQ(grid.OccupancyAt(p + 3.0 * along), kUnknownCell) << along.transpose();
  }
  EXPECT_LT(grid.OccupancyAt({1.851, 0.001}), 50);  // Three cells before the hit the ray has passed.
  // Log odds of 3 hits: a third of a hit's at two cells' distance.
  const double whole = 3.0 * std::log(0.7 / 0.3);
  EXPECT_NEAR(grid.OccupancyAt({2.101, 0.001}), 100.0 / (1.0 + std::exp(-whole / 3.0)), 1.5);
}

TEST(OccupancyGrid, ACellHitByOneBeamIsNotClearedByAnotherOfTheSameScan) {
  OccupancyGrid grid{GridOptions{}};
  Scan scan;
  scan.angle_first_rad = 0.0;
  scan.angle_step_rad = 0.001;
  scan.range_max_m = 30.0;
  scan.ranges_m = {2.0F, 4.0F, 2.0F};
  grid.Draw(scan, {0.001, 0.001, 0.0});
  EXPECT_GT(grid.OccupancyAt({2.001, 0.001}), 50);
}

TEST(OccupancyGrid, GridsThatShareChunksPartWhenOneDraws) {
  OccupancyGrid grid{GridOptions{}};
  grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {});
  OccupancyGrid copy(grid.options(), grid.Share());
  EXPECT_EQ(grid.Share(), copy.Share()) << "the same chunks, not equal ones";
  const GridChunk before = *copy.Share().begin()->second;
  grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {});
  EXPECT_NE(grid.Share().begin()->second, copy.Share().begin()->second);
  EXPECT_EQ(before.log_odds, copy.Share().begin()->second->log_odds);
}

TEST(OccupancyGrid, AChangeIsReportedOnce) {
  OccupancyGrid grid{GridOptions{}};
  grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {});
  EXPECT_EQ(grid.TakeChange().size(), grid.chunk_count());
  EXPECT_TRUE(grid.TakeChange().empty());
}

// A cell that holds the most can be looked at without a change.
TEST(OccupancyGrid, TheCellsThatAScanTouchesAreTold) {
  const Scan scan = Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser());
  OccupancyGrid grid{GridOptions{}};
  for (int look = 0; look < 50; ++look) grid.Draw(scan, {});
  const auto before = grid.Share();
  OccupancyGrid::Looks looks;
  grid.Draw(scan, {}, {}, &looks);
  std::size_t touched = 0;
  for (const auto& [key, chunk] : grid.Share()) {
    EXPECT_EQ(chunk->log_odds, before.at(key)->log_odds);
    for (std::size_t cell = 0; cell < kTileArea; ++cell) {
      const bool looked = looks.contains(key) && looks.at(key).Has(cell);
      EXPECT_EQ(looked, chunk->log_odds[cell] != kUnseen);
      touched += looked ? 1 : 0;
    }
  }
  EXPECT_GT(touched, 5000U);
}

// A copy of the grid that is kept by changes must also remove the chunks that only the old grid had.
TEST(OccupancyGrid, ReplacingItChangesTheChunksOfBoth) {
  OccupancyGrid grid{GridOptions{}}, other{GridOptions{}};
  grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {});
  static_cast<void>(grid.TakeChange());
  other.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {40.0, 0.0, 0.0});
  const std::size_t old = grid.chunk_count(), taken = other.chunk_count();
  grid.ReplaceBy(std::move(other));
  EXPECT_EQ(grid.chunk_count(), taken);
  std::size_t gone = 0, there = 0;
  for (const auto& [key, chunk] : grid.TakeChange()) ++(chunk ? there : gone);
  EXPECT_EQ(gone, old);
  EXPECT_EQ(there, taken);
}

TEST(OccupancyGrid, AHandedOutChunkNeverChanges) {
  OccupancyGrid grid{GridOptions{}};
  const auto draw = [&] { grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {}); };
  draw();
  const OccupancyGrid::SharedChunk shared = grid.Share().begin()->second;
  const GridChunk shared_before = *shared;
  draw();
  EXPECT_EQ(shared_before.log_odds, shared->log_odds);
  EXPECT_NE(shared_before.log_odds, grid.Share().begin()->second->log_odds);

  const OccupancyGrid::SharedChunk taken = grid.TakeChange().front().second;
  const GridChunk taken_before = *taken;
  draw();
  EXPECT_EQ(taken_before.log_odds, taken->log_odds);
  EXPECT_NE(taken_before.log_odds, grid.Share().begin()->second->log_odds);
}

TEST(GridImage, ShowsTheGridAtItsPlace) {
  OccupancyGrid grid{GridOptions{}};
  for (int i = 0; i < 5; ++i) grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser(720)), {});
  const OccupancyImage image = ImageOf(grid);
  EXPECT_EQ(image.width % kTileCells, 0);
  const auto column = static_cast<int>((3.01 - image.T_map_origin.x) / image.resolution_m);
  const auto row = static_cast<int>((0.0 - image.T_map_origin.y) / image.resolution_m);
  EXPECT_EQ(image.cells[static_cast<std::size_t>(row * image.width + column)], grid.OccupancyAt({3.01, 0.0}));
}

}  // namespace
}  // namespace cairn::slam
