#include "server/maps/localising_tiles.h"

#include <gtest/gtest.h>

#include "server/maps/tile_encoding.h"

namespace cairn::server {
namespace {

MapEdit EditOf(MapEditKind kind, double x_m) {
  MapEdit edit;
  edit.kind = kind;
  edit.points_map = {{x_m, 0.0}, {x_m + 0.1, 0.0}, {x_m + 0.1, 0.1}, {x_m, 0.1}};
  return edit;
}

// As a site publishes it: with all edits in its tiles.
TEST(LocalisingTiles, WallsThatPeopleDrewAreUnknownAndAllElseIsAsItIs) {
  TileCells first, second;
  first.fill(0);
  second.fill(0);
  first[0] = first[1] = 100;    // Someone has drawn it, and nobody has said anything else since.
  first[20] = first[21] = 100;  // Drawn, and erased again below.
  first[20] = first[21] = 0;
  first[40] = first[41] = kUnknownCell;
  MapSnapshot map;
  map.info.resolution_m = 0.05;
  map.tiles = map.tiles.With(
      {{{0, 0, 0}, EncodeTile({0, 0, 0}, first, 3, 7)}, {{0, 1, 0}, EncodeTile({0, 1, 0}, second, 3, 8)}});
  std::vector<MapEdit> edits = {EditOf(MapEditKind::kOccupied, 0.0), EditOf(MapEditKind::kOccupied, 1.0),
                                EditOf(MapEditKind::kFree, 1.0), EditOf(MapEditKind::kUnknown, 2.0),
                                EditOf(MapEditKind::kKeepOut, 3.0)};
  map.edits = std::make_shared<const std::vector<MapEdit>>(edits);
  const auto tiles = TilesToLocaliseIn(map);
  ASSERT_EQ(tiles.size(), 2U);
  EXPECT_EQ(tiles[1], map.tiles.Find({0, 1, 0})) << "no wall is here";
  EXPECT_EQ(tiles[0]->version, 7U);
  EXPECT_EQ(tiles[0]->epoch, 3U);
  const auto cells = DecodeCells(tiles[0]->bytes, tiles[0]->encoding);
  ASSERT_TRUE(cells);
  EXPECT_EQ((*cells)[0], kUnknownCell);
  EXPECT_EQ((*cells)[kTileCells + 1], kUnknownCell);
  EXPECT_EQ((*cells)[2], 0);
  EXPECT_EQ((*cells)[20], 0) << "what was said last counts";
  EXPECT_EQ((*cells)[40], kUnknownCell);
  EXPECT_EQ((*cells)[60], 0) << "lidars see through an area to keep out of";

  map.edits = std::make_shared<const std::vector<MapEdit>>(edits.begin() + 2, edits.end());
  EXPECT_EQ(TilesToLocaliseIn(map)[0], map.tiles.Find({0, 0, 0})) << "without walls the tiles are those of the map";
}

TEST(LocalisingTiles, AMapWiderThanASearchAllowsIsTooLarge) {
  TileCells cells;
  cells.fill(0);
  const double side_m = 0.05 * kTileCells;
  const int most = static_cast<int>(slam::KnownGrid::kMostM / side_m);  // Tiles in a row.
  const auto with = [&](int x, int y) {
    MapSnapshot map;
    map.info.resolution_m = 0.05;
    map.tiles = map.tiles.With(
        {{{0, 0, 0}, EncodeTile({0, 0, 0}, cells, 1, 1)}, {{0, x, y}, EncodeTile({0, x, y}, cells, 1, 1)}});
    return IsSmallEnoughToLocaliseIn(map);
  };
  EXPECT_TRUE(IsSmallEnoughToLocaliseIn({}));
  for (const int far : {most - 1, 1 - most}) {
    EXPECT_TRUE(with(far, 0));
    EXPECT_TRUE(with(0, far));
  }
  for (const int far : {most, -most}) {
    EXPECT_FALSE(with(far, 0));
    EXPECT_FALSE(with(0, far));
  }
}

}  // namespace
}  // namespace cairn::server
