#include "server/ros2/site_grid.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

using Clock = SiteGrid::Clock;

class GridTest : public testing::Test {
 protected:
  GridTest() { Info(0, 0); }

  void Info(std::uint32_t epoch, std::uint32_t tile_count) {
    MapInfo info;
    info.site = "lab";
    info.resolution_m = 0.05;
    info.epoch = epoch;
    info.tile_count = tile_count;
    grid_.Take(info);
  }

  void Tile(int x, int y, std::uint8_t value, std::uint32_t epoch = 0, bool deleted = false) {
    TileSample sample;
    sample.tile.key = {0, x, y};
    sample.tile.epoch = epoch;
    sample.deleted = deleted;
    TileCells cells;
    cells.fill(kUnknownCell);
    cells[0] = value;  // The lower left corner.
    if (!deleted) sample.tile.bytes = EncodeCells(cells, sample.tile.encoding);
    grid_.Take(sample);
  }
  SiteGrid::Due After(std::chrono::milliseconds time, bool wanted = false) {
    now_ += time;
    return grid_.Next(wanted, 7, now_);
  }
  static std::int8_t At(const ros2::Grid& grid, std::size_t x, std::size_t y) {
    return grid.cells.at(y * grid.width + x);
  }

  SiteGrid grid_{"map", 5.0, 40 * kTileArea};
  Clock::time_point now_ = Clock::time_point() + std::chrono::hours(1);
};

TEST_F(GridTest, NothingIsPublishedOfAnEmptySite) {
  EXPECT_TRUE(std::holds_alternative<std::monostate>(After(std::chrono::seconds(10), true)));
}

TEST_F(GridTest, WhoAsksGetsTheMapAsItIsNowWhateverWasPublished) {
  EXPECT_TRUE(grid_.Now(9).cells.empty());
  EXPECT_EQ(grid_.Now(9).header.frame, "map");
  Tile(0, 0, 100);
  static_cast<void>(After(std::chrono::milliseconds(0)));
  Tile(1, 0, 50);
  const ros2::Grid now = grid_.Now(9);
  EXPECT_EQ(now.header.stamp, 9);
  EXPECT_EQ(now.width, 2U * kTileCells);
  EXPECT_EQ(now.height, static_cast<std::uint32_t>(kTileCells));
  EXPECT_EQ(At(now, 0, 0), 100);
  EXPECT_EQ(At(now, kTileCells, 0), 50);
  // Asking takes nothing away from what is published.
  EXPECT_TRUE(std::holds_alternative<ros2::Grid>(After(SiteGrid::kShortestPeriod)));
}

TEST_F(GridTest, WhoAsksForAMapThatIsTooLargeGetsNoCells) {
  Tile(0, 0, 100);
  Tile(40, 0, 100);
  EXPECT_TRUE(grid_.Now(9).cells.empty());
  EXPECT_EQ(grid_.Now(9).width, 0U);
}

TEST_F(GridTest, TilesStandAtTheirPlaceWithTheValuesOfRos) {
  Tile(-1, 0, 100);
  Tile(0, 1, 0);
  const auto due = After(std::chrono::milliseconds(0));
  const auto& whole = std::get<ros2::Grid>(due);
  EXPECT_EQ(whole.header.frame, "map");
  EXPECT_EQ(whole.width, 2U * kTileCells);
  EXPECT_EQ(whole.height, 2U * kTileCells);
  EXPECT_NEAR(whole.T_frame_origin.x, -kTileCells * 0.05, 1e-12);
  EXPECT_EQ(whole.T_frame_origin.y, 0.0);
  EXPECT_EQ(At(whole, 0, 0), 100);
  EXPECT_EQ(At(whole, kTileCells, kTileCells), 0);
  EXPECT_EQ(At(whole, 1, 0), -1);
  EXPECT_EQ(At(whole, kTileCells, 0), -1) << "a tile that is not there is unknown";
}

TEST_F(GridTest, ChangesWithinTheMapAreARectangle) {
  Tile(0, 0, 1);
  Tile(2, 0, 1);
  ASSERT_TRUE(std::holds_alternative<ros2::Grid>(After(std::chrono::milliseconds(0))));
  EXPECT_TRUE(std::holds_alternative<std::monostate>(After(std::chrono::milliseconds(200))));
  Tile(2, 0, 55);
  const auto due = After(std::chrono::milliseconds(200));
  const auto& update = std::get<ros2::GridUpdate>(due);
  EXPECT_EQ(update.x, 2 * kTileCells);
  EXPECT_EQ(update.y, 0);
  EXPECT_EQ(update.width, static_cast<std::uint32_t>(kTileCells));
  EXPECT_EQ(update.cells.at(0), 55);
  // The last whole map is older than its changes: it follows within its period, once.
  const auto later = After(std::chrono::seconds(5));
  EXPECT_EQ(At(std::get<ros2::Grid>(later), 2 * kTileCells, 0), 55);
  EXPECT_TRUE(std::holds_alternative<std::monostate>(After(std::chrono::seconds(5), true)));
}

TEST_F(GridTest, WhoBeginsToListenGetsAMapThatIsNotOld) {
  Tile(0, 0, 1);
  static_cast<void>(After(std::chrono::milliseconds(0)));
  Tile(0, 0, 2);
  ASSERT_TRUE(std::holds_alternative<ros2::GridUpdate>(After(std::chrono::milliseconds(100))));
  const auto due = After(std::chrono::milliseconds(100), true);
  EXPECT_EQ(At(std::get<ros2::Grid>(due), 0, 0), 2);
}

TEST_F(GridTest, AMapThatGrowsIsPublishedWholeOnceASecond) {
  Tile(0, 0, 1);
  static_cast<void>(After(std::chrono::milliseconds(0)));
  Tile(1, 0, 1);
  EXPECT_TRUE(std::holds_alternative<std::monostate>(After(std::chrono::milliseconds(500))));
  const auto due = After(std::chrono::milliseconds(500));
  EXPECT_EQ(std::get<ros2::Grid>(due).width, 2U * kTileCells);
}

TEST_F(GridTest, ANewEpochKeepsNothingOfTheOldOne) {
  Tile(0, 0, 1);
  Tile(1, 0, 1);
  static_cast<void>(After(std::chrono::milliseconds(0)));
  Info(1, 1);
  Tile(1, 0, 9, 1);
  Tile(0, 0, 5, 0);  // Late, of the old one.
  const auto due = After(std::chrono::seconds(1));
  const auto& whole = std::get<ros2::Grid>(due);
  EXPECT_EQ(whole.width, static_cast<std::uint32_t>(kTileCells));
  EXPECT_NEAR(whole.T_frame_origin.x, kTileCells * 0.05, 1e-12);
  EXPECT_EQ(At(whole, 0, 0), 9);
}

TEST_F(GridTest, AMapOfWhichTilesAreMissingIsNotPublishedAndTheOneBeforeIsAnswered) {
  Info(0, 2);
  Tile(0, 0, 1);
  EXPECT_TRUE(std::holds_alternative<std::monostate>(After(std::chrono::seconds(1), true)));
  EXPECT_TRUE(grid_.Now(9).cells.empty());
  Tile(1, 0, 1);
  EXPECT_TRUE(std::holds_alternative<ros2::Grid>(After(std::chrono::seconds(0))));
  Info(1, 2);
  Tile(0, 0, 9, 1);
  EXPECT_TRUE(std::holds_alternative<std::monostate>(After(std::chrono::milliseconds(1500), true)));
  EXPECT_EQ(At(grid_.Now(9), 0, 0), 1);
  EXPECT_EQ(grid_.Now(9).width, 2U * kTileCells);
  Tile(1, 0, 9, 1);
  const auto due = After(std::chrono::milliseconds(100));  // Whoever began to listen meanwhile gets all of it.
  EXPECT_EQ(At(std::get<ros2::Grid>(due), 0, 0), 9);
  EXPECT_EQ(std::get<ros2::Grid>(due).width, 2U * kTileCells);
  EXPECT_EQ(At(grid_.Now(9), 0, 0), 9);
}

TEST_F(GridTest, TilesThatDoNotComeAreNotWaitedForForEver) {
  Info(0, 2);
  Tile(0, 0, 1);
  EXPECT_TRUE(std::holds_alternative<std::monostate>(After(std::chrono::seconds(1))));
  EXPECT_TRUE(std::holds_alternative<ros2::Grid>(After(SiteGrid::kCompleteWithin)));
  EXPECT_EQ(At(grid_.Now(9), 0, 0), 1);
  // The next whole change is waited for again.
  Info(1, 2);
  Tile(0, 0, 9, 1);
  EXPECT_TRUE(std::holds_alternative<std::monostate>(After(std::chrono::milliseconds(1500))));
  EXPECT_EQ(At(grid_.Now(9), 0, 0), 1);
  EXPECT_FALSE(std::holds_alternative<std::monostate>(After(SiteGrid::kCompleteWithin)));
}

TEST_F(GridTest, ASiteThatWasEmptiedBecomesUnknown) {
  Tile(0, 0, 1);
  static_cast<void>(After(std::chrono::milliseconds(0)));
  Info(1, 0);
  Tile(0, 0, 0, 1, true);
  const auto due = After(std::chrono::seconds(6));
  EXPECT_EQ(At(std::get<ros2::Grid>(due), 0, 0), -1);
}

TEST_F(GridTest, AMapThatIsTooLargeIsNotPublished) {
  Tile(0, 0, 1);
  Tile(40, 0, 1);
  EXPECT_TRUE(std::holds_alternative<std::monostate>(After(std::chrono::seconds(9), true)));
  EXPECT_TRUE(grid_.too_large());
}

}  // namespace
}  // namespace cairn::server
