#include "common/map/occupancy_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace cairn {
namespace {

Tile TileOf(int x, int y, std::uint8_t value, TileEncoding encoding = TileEncoding::kPng) {
  TileCells cells;
  cells.fill(value);
  return {{0, x, y}, 1, 1, encoding, EncodeCells(cells, encoding)};
}

TEST(AssembleTiles, NothingGivesAnEmptyImage) {
  const auto image = AssembleTiles({}, 0.05);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->width, 0);
  EXPECT_EQ(image->height, 0);
  EXPECT_TRUE(image->cells.empty());
}

TEST(AssembleTiles, FillsTheBoundingBox) {
  const auto image = AssembleTiles({TileOf(-1, 2, 100), TileOf(1, 1, 0, TileEncoding::kRaw)}, 0.1);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->width, 3 * kTileCells);
  EXPECT_EQ(image->height, 2 * kTileCells);
  EXPECT_DOUBLE_EQ(image->T_map_origin.x, -12.8);
  EXPECT_DOUBLE_EQ(image->T_map_origin.y, 12.8);
  const auto at = [&](int x, int y) { return int{image->cells[static_cast<std::size_t>(y * image->width + x)]}; };
  EXPECT_EQ(at(0, kTileCells), 100);    // Tile (-1, 2): left, upper row.
  EXPECT_EQ(at(2 * kTileCells, 0), 0);  // Tile (1, 1): right, lower row.
  EXPECT_EQ(at(0, 0), kUnknownCell);
  EXPECT_EQ(at(kTileCells, kTileCells), kUnknownCell);
}

TEST(AssembleTiles, RefusesWhatMakesNoOneMap) {
  Tile coarse = TileOf(0, 0, 0);
  coarse.key.level = 1;
  EXPECT_FALSE(AssembleTiles({coarse}, 0.05));
  EXPECT_FALSE(AssembleTiles({TileOf(0, 0, 0), TileOf(0, 0, 0)}, 0.05));
  EXPECT_FALSE(AssembleTiles({TileOf(0, 0, 0)}, 0.0));
  EXPECT_FALSE(AssembleTiles({TileOf(0, 0, 0)}, std::numeric_limits<double>::quiet_NaN()));
  Tile broken = TileOf(0, 0, 0);
  broken.bytes.resize(10);
  EXPECT_FALSE(AssembleTiles({broken}, 0.05));
}

TEST(AssembleTiles, RefusesABoxTooLargeForOneImage) {
  constexpr int kMin = std::numeric_limits<int>::min(), kMax = std::numeric_limits<int>::max();
  const auto image = AssembleTiles({TileOf(kMin, kMin, 0), TileOf(kMax, kMax, 0)}, 0.05);
  ASSERT_FALSE(image);
  EXPECT_EQ(image.error().code, StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace cairn
