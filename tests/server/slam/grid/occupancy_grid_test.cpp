#include "server/slam/grid/occupancy_grid.h"

#include <gtest/gtest.h>

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

TEST(OccupancyGrid, DeterministicCellsFollowTheLastScan) {
  GridOptions options;
  options.model = GridModel::kDeterministic;
  OccupancyGrid grid(options);
  for (int i = 0; i < 5; ++i) grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser(720)), {});
  grid.Draw(Look(Room(-5, -2, 10, 4), {}, test::FullTurnLaser(720)), {});
  EXPECT_LT(grid.OccupancyAt({3.01, 0.0}), 20);
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

TEST(OccupancyGrid, SharedGridsPartWhenOneDraws) {
  OccupancyGrid grid{GridOptions{}};
  grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {});
  OccupancyGrid copy = grid.Share();
  const auto shared = grid.chunks().begin()->second;
  EXPECT_EQ(shared, copy.chunks().begin()->second);
  const GridChunk before = *shared;
  grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {});
  EXPECT_NE(grid.chunks().begin()->second, copy.chunks().begin()->second);
  EXPECT_EQ(before.log_odds, copy.chunks().begin()->second->log_odds);
}

TEST(OccupancyGrid, DirtyChunksAreReportedOnce) {
  OccupancyGrid grid{GridOptions{}};
  grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {});
  EXPECT_EQ(grid.TakeDirty().size(), grid.chunks().size());
  EXPECT_TRUE(grid.TakeDirty().empty());
}

TEST(OccupancyGrid, AHandedOutChunkNeverChanges) {
  OccupancyGrid grid{GridOptions{}};
  grid.Draw(Look(Room(-3, -2, 6, 4), {}, test::FullTurnLaser()), {});
  const OccupancyGrid::Chunks published = grid.Publish();
  const auto [key, chunk] = *published.begin();
  const GridChunk before = *chunk;
  grid.Draw(Look(Room(-2, -2, 6, 4), {}, test::FullTurnLaser()), {});
  EXPECT_EQ(before.log_odds, chunk->log_odds);
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
