// Maps from files as tiles: where their cells come to lie.
#include "common/map/map_tiles.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "tests/temp_directory.h"

namespace cairn {
namespace {

// Free, with one occupied cell at `column`, `row`.
OccupancyImage ImageWithOneWall(double resolution_m, const Pose2& T_map_origin, int side, int column, int row) {
  OccupancyImage map{resolution_m, T_map_origin, side, side, {}};
  map.cells.assign(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), 0);
  map.cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(side) + static_cast<std::size_t>(column)] = 100;
  return map;
}

// The cell of the tiles at a point of the map frame; unknown where there is no tile.
std::uint8_t CellAt(const std::map<TileKey, TileCells>& tiles, double x, double y, double resolution_m) {
  const int column = static_cast<int>(std::floor(x / resolution_m)),
            row = static_cast<int>(std::floor(y / resolution_m));
  const TileKey key{0, FloorDiv(column, kTileCells), FloorDiv(row, kTileCells)};
  const auto tile = tiles.find(key);
  if (tile == tiles.end()) return kUnknownCell;
  const int inside = (row - key.y * kTileCells) * kTileCells + column - key.x * kTileCells;
  return tile->second[static_cast<std::size_t>(inside)];
}

// What `cairn map export` has written comes back cell by cell.
TEST(MapTiles, AMapThatWasExportedComesBackAsItsTiles) {
  std::map<TileKey, TileCells> tiles;
  for (const TileKey key : {TileKey{0, -1, 0}, TileKey{0, 1, -2}}) {
    TileCells& cells = tiles[key];
    for (std::size_t i = 0; i < cells.size(); ++i) {
      constexpr std::uint8_t kValues[] = {0, 100, kUnknownCell};
      cells[i] = kValues[(i * 7 + i / 128) % 3];
    }
  }
  std::vector<Tile> published;
  for (const auto& [key, cells] : tiles)
    published.push_back({.key = key, .encoding = TileEncoding::kPng, .bytes = EncodeCells(cells, TileEncoding::kPng)});
  const TempDirectory directory;
  for (const std::string extension : {".png", ".pgm"}) {
    const auto image = AssembleTiles(published, 0.05);
    ASSERT_TRUE(image);
    ASSERT_TRUE(SaveMapYaml(*image, directory / "map.yaml", extension, {}));
    const auto read = LoadMapYaml(directory / "map.yaml");
    ASSERT_TRUE(read) << read.error().message;
    const auto again = ResampleToTiles(*read, 0.05);
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_TRUE(*again == tiles) << extension;
  }
}

TEST(MapTiles, CellsLieWhereTheOriginAndItsHeadingPutThem) {
  const Pose2 T_map_origin{3.0, -2.0, 0.5 * kPi};
  const OccupancyImage map = ImageWithOneWall(0.05, T_map_origin, 40, 30, 4);
  const auto tiles = ResampleToTiles(map, 0.05);
  ASSERT_TRUE(tiles);
  const Eigen::Vector2d wall = T_map_origin * Eigen::Vector2d(30.5 * 0.05, 4.5 * 0.05);
  EXPECT_NEAR(wall.x(), 2.775, 1e-9);
  EXPECT_NEAR(wall.y(), -0.475, 1e-9);
  EXPECT_EQ(CellAt(*tiles, wall.x(), wall.y(), 0.05), 100);
  EXPECT_EQ(CellAt(*tiles, wall.x() + 0.05, wall.y(), 0.05), 0);
  EXPECT_EQ(CellAt(*tiles, wall.x(), wall.y() + 0.05, 0.05), 0);
  // The image lies left of its origin, because it is turned by a quarter.
  EXPECT_EQ(CellAt(*tiles, 3.025, -1.0, 0.05), kUnknownCell);
  EXPECT_EQ(CellAt(*tiles, 2.975, -1.0, 0.05), 0);
}

TEST(MapTiles, CellsOfAnotherSizeKeepTheirWalls) {
  // Four cells become one, and none of four vanishes.
  for (int column = 20; column < 24; ++column) {
    const auto coarse = ResampleToTiles(ImageWithOneWall(0.0125, {}, 40, column, 21), 0.05);
    ASSERT_TRUE(coarse);
    EXPECT_EQ(CellAt(*coarse, 0.275, 0.275, 0.05), 100) << column;
    EXPECT_EQ(CellAt(*coarse, 0.325, 0.275, 0.05), 0);
  }
  // One becomes sixteen.
  const auto fine = ResampleToTiles(ImageWithOneWall(0.2, {}, 10, 2, 3), 0.05);
  ASSERT_TRUE(fine);
  for (const double x : {0.425, 0.475, 0.525, 0.575}) {
    for (const double y : {0.625, 0.675, 0.725, 0.775}) EXPECT_EQ(CellAt(*fine, x, y, 0.05), 100) << x << ' ' << y;
  }
  EXPECT_EQ(CellAt(*fine, 0.375, 0.625, 0.05), 0);
  EXPECT_EQ(CellAt(*fine, 0.625, 0.625, 0.05), 0);
}

TEST(MapTiles, WhatCannotBeAMapIsRefusedWithAReason) {
  const auto code = [](const OccupancyImage& map, double resolution_m = 0.05) {
    const auto tiles = ResampleToTiles(map, resolution_m);
    EXPECT_FALSE(tiles);
    EXPECT_FALSE(tiles.error().message.empty());
    return tiles.error().code;
  };
  const OccupancyImage good = ImageWithOneWall(0.05, {}, 10, 2, 3);
  EXPECT_EQ(code({}), StatusCode::kInvalidArgument);
  OccupancyImage bad = good;
  bad.cells.pop_back();
  EXPECT_EQ(code(bad), StatusCode::kInvalidArgument);
  bad = good;
  bad.cells.assign(bad.cells.size(), kUnknownCell);
  EXPECT_EQ(code(bad), StatusCode::kInvalidArgument);
  for (const double side_m : {0.0, -1.0, 20.0, std::numeric_limits<double>::quiet_NaN()}) {
    bad = good;
    bad.resolution_m = side_m;
    EXPECT_EQ(code(bad), StatusCode::kInvalidArgument) << side_m;
    EXPECT_EQ(code(good, side_m), StatusCode::kInvalidArgument) << side_m;
  }
  EXPECT_EQ(code(good, 5.0), StatusCode::kInvalidArgument) << "a hundred cells in one";
  bad = good;
  bad.T_map_origin.x = 1e9;
  EXPECT_EQ(code(bad), StatusCode::kOutOfRange);
  bad.T_map_origin.x = std::numeric_limits<double>::infinity();
  EXPECT_EQ(code(bad), StatusCode::kInvalidArgument);
  EXPECT_EQ(code(ImageWithOneWall(10.0, {}, 110, 2, 3), 1.0), StatusCode::kOutOfRange) << "1100 m";
  EXPECT_EQ(code(ImageWithOneWall(1.0, {}, 900, 2, 3)), StatusCode::kResourceExhausted) << "18,000 x 18,000 cells";
}

}  // namespace
}  // namespace cairn
