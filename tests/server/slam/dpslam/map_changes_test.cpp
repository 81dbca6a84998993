#include "server/slam/dpslam/map_changes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <utility>

#include "server/slam/state/archive.h"

namespace cairn::slam {
namespace {

using Sums = std::map<std::pair<int, int>, CellCounts>;

Sums SumsOf(const MapChanges& changes) {
  Sums sums;
  for (const auto& tile : changes.tiles())
    tile->ForEach([&](std::uint16_t cell, std::uint16_t travel, std::uint16_t stops) {
      CellCounts& sum = sums[{tile->key.x * kChangeTileSide + cell % kChangeTileSide,
                              tile->key.y * kChangeTileSide + cell / kChangeTileSide}];
      sum = {sum.travel + travel, sum.stops + stops};
    });
  return sums;
}

MapChanges RandomChanges(std::mt19937_64& rng, int tiles, double density) {
  std::map<ChangeTileKey, ChangeTile> made;
  for (int t = 0; t < tiles; ++t) {
    ChangeTile tile;
    tile.key = {static_cast<int>(rng() % 7) - 3, static_cast<int>(rng() % 7) - 3};
    for (int cell = 0; cell < kChangeTileArea; ++cell)
      if (static_cast<double>(rng() % 1000) < 1000.0 * density)
        tile.list.push_back({static_cast<std::uint16_t>(cell), static_cast<std::uint16_t>(1 + rng() % 90),
                             static_cast<std::uint16_t>(rng() % 3)});
    if (!tile.list.empty()) made[tile.key] = tile;
  }
  MapChanges changes;
  for (auto& [key, tile] : made) changes.Append(std::move(tile));
  return changes;
}

TEST(MapChanges, AddingIsAddingCellByCellHoweverManyTheyAre) {
  std::mt19937_64 rng(2);
  for (int round = 0; round < 8; ++round) {
    MapChanges sum;
    Sums oracle;
    for (int i = 0; i < 8; ++i) {
      MapChanges more = RandomChanges(rng, static_cast<int>(rng() % 20), i % 3 == 0 ? 0.5 : 0.02);
      for (const auto& [cell, counts] : SumsOf(more))
        oracle[cell] = {oracle[cell].travel + counts.travel, oracle[cell].stops + counts.stops};
      if (rng() % 2 == 0) std::swap(sum, more);  // Either may be the smaller.
      sum.Add(std::move(more));
    }
    ASSERT_EQ(SumsOf(sum), oracle);
    for (std::size_t i = 1; i < sum.tiles().size(); ++i) ASSERT_LT(sum.tiles()[i - 1]->key, sum.tiles()[i]->key);
  }
}

TEST(MapChanges, ATileNeverTakesMoreThanAllItsCells) {
  std::mt19937_64 rng(3);
  MapChanges sum;
  for (int i = 0; i < 60; ++i) sum.Add(RandomChanges(rng, 49, 0.02));
  EXPECT_EQ(sum.tiles().size(), 49u);
  EXPECT_LE(sum.bytes(), 64 * (sizeof(ChangeTile) + kChangeTileArea * sizeof(ChangeTile::Counts)));
}

TEST(MapChanges, ACheckpointKeepsWhatItSharesWhileTheMapGoesOn) {
  std::mt19937_64 rng(4);
  MapChanges changes = RandomChanges(rng, 20, 0.02);
  const Sums before = SumsOf(changes);
  StateWriter checkpoint;
  checkpoint(changes);
  for (int i = 0; i < 20; ++i) changes.Add(RandomChanges(rng, 20, 0.1));
  EXPECT_NE(SumsOf(changes), before);
  const std::string bytes = checkpoint.Bytes();
  StateReader reader(bytes);
  MapChanges read;
  reader(read);
  ASSERT_TRUE(reader.done()) << reader.failed();
  EXPECT_EQ(SumsOf(read), before);
  read.Add(MapChanges(changes));
  EXPECT_NE(SumsOf(read), before);
}

// Until format 10 the tiles stood where the map stands.
TEST(MapChanges, AreReadFromCheckpointsOfEarlierFormats) {
  std::mt19937_64 rng(5);
  const MapChanges changes = RandomChanges(rng, 20, 0.3);
  std::vector<ChangeTile> tiles;
  for (const auto& tile : changes.tiles()) tiles.push_back(*tile);
  StateWriter writer;
  writer(tiles);
  const std::string bytes = writer.Bytes();
  StateReader reader(bytes, {}, 10);
  MapChanges read;
  reader(read);
  ASSERT_TRUE(reader.done()) << reader.failed();
  EXPECT_EQ(SumsOf(read), SumsOf(changes));
  std::swap(tiles[0], tiles[1]);
  StateWriter disordered;
  disordered(tiles);
  const std::string wrong = disordered.Bytes();
  StateReader refusing(wrong, {}, 10);
  refusing(read);
  EXPECT_STREQ(refusing.failed(), "the tiles of a map");
}

TEST(MapChanges, EvidenceAgesInsteadOfOverflowing) {
  MapChanges sum;
  for (int i = 0; i < 3000; ++i) {
    ChangeTile tile;
    tile.list.push_back({7, 1000, 10});
    MapChanges more;
    more.Append(std::move(tile));
    sum.Add(std::move(more));
  }
  const CellCounts counts = SumsOf(sum).begin()->second;
  EXPECT_GT(counts.travel, 30000u);
  EXPECT_NEAR(static_cast<double>(counts.travel) / counts.stops, 100.0, 1.0);
}

TEST(ChangePainter, OneRayLeavesItsTravelAndOneStop) {
  LaserRays rays;
  rays.rays.push_back({{1.0, 0.0}, 0.12, true});
  ChangePainter painter(0.05);
  painter.Draw(rays, {0.025, 0.025, 0.0});
  const Sums sums = SumsOf(painter.Take());
  ASSERT_EQ(sums.size(), 3u);
  EXPECT_EQ(sums.at({0, 0}), (CellCounts{16, 0}));  // Half a cell, in 1/32.
  EXPECT_EQ(sums.at({1, 0}), (CellCounts{32, 0}));
  EXPECT_EQ(sums.at({2, 0}), (CellCounts{29, 1}));  // 0.9 of one.
  EXPECT_TRUE(painter.Take().empty());
}

TEST(ChangePainter, KeepsAllTravelAndAllStopsAcrossTiles) {
  std::mt19937_64 rng(4);
  ChangePainter painter(0.05);
  LaserRays rays;
  double way = 0.0;
  for (int i = 0; i < 400; ++i) {
    const double angle = 0.0157 * i, length = 0.5 + 0.001 * static_cast<double>(rng() % 9000);
    rays.rays.push_back({{std::cos(angle), std::sin(angle)}, length, i % 5 != 0});
    way += length / 0.05;
  }
  painter.Draw(rays, {-3.3, 1.2, 0.7});
  double travel = 0.0;
  std::uint32_t stops = 0;
  for (const auto& [cell, counts] : SumsOf(painter.Take()))
    travel += counts.travel / kTravelPerCell, stops += counts.stops;
  EXPECT_EQ(stops, 320u);
  EXPECT_NEAR(travel / way, 1.0, 1e-3);
}

TEST(ChangePainter, BurstsOfRaysInOneCellStayInRange) {
  LaserRays rays;
  for (int i = 0; i < 8192; ++i) rays.rays.push_back({{1.0, 0.0}, 0.04, true});
  ChangePainter painter(0.05);
  for (int i = 0; i < 20; ++i) painter.Draw(rays, {0.005, 0.025, 0.0});
  const Sums sums = SumsOf(painter.Take());
  ASSERT_EQ(sums.size(), 1u);
  const CellCounts counts = sums.begin()->second;
  EXPECT_LE(counts.travel, 65535u);
  EXPECT_NEAR(static_cast<double>(counts.travel) / counts.stops, 0.8 * kTravelPerCell, 0.1);
}

}  // namespace
}  // namespace cairn::slam
