#include "common/map/tile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace cairn {
namespace {

TileCells RandomCells(unsigned seed) {
  std::mt19937_64 random(seed);
  TileCells cells;
  for (auto& cell : cells) cell = random() % 4 == 0 ? kUnknownCell : static_cast<std::uint8_t>(random() % 101);
  return cells;
}

TEST(Tile, RoundTripsInBothEncodings) {
  for (const TileEncoding encoding : {TileEncoding::kRaw, TileEncoding::kPng}) {
    for (unsigned seed = 0; seed < 5; ++seed) {
      const TileCells cells = RandomCells(seed);
      const auto decoded = DecodeCells(EncodeCells(cells, encoding), encoding);
      ASSERT_TRUE(decoded) << decoded.error().message;
      EXPECT_EQ(*decoded, cells);
    }
  }
}

TEST(Tile, FitsOneMessageEvenWhenIncompressible) {
  EXPECT_LT(EncodeCells(RandomCells(1), TileEncoding::kPng).size(), 64u * 1024 - 512);
  EXPECT_EQ(EncodeCells(RandomCells(1), TileEncoding::kRaw).size(), static_cast<std::size_t>(kTileArea));
}

TEST(Tile, AnEmptyTileIsSmallAsPng) {
  TileCells cells;
  cells.fill(kUnknownCell);
  EXPECT_LT(EncodeCells(cells, TileEncoding::kPng).size(), 500u);
}

TEST(Tile, SameCellsGiveSameBytes) {
  EXPECT_EQ(EncodeCells(RandomCells(3), TileEncoding::kPng), EncodeCells(RandomCells(3), TileEncoding::kPng));
}

TEST(Tile, WrongLengthsEncodingsAndValuesAreRefused) {
  EXPECT_FALSE(DecodeCells({}, TileEncoding::kRaw));
  EXPECT_FALSE(DecodeCells({}, TileEncoding::kPng));
  EXPECT_FALSE(DecodeCells(std::vector<std::uint8_t>(kTileArea - 1), TileEncoding::kRaw));
  EXPECT_FALSE(DecodeCells(std::vector<std::uint8_t>(kTileArea + 1), TileEncoding::kRaw));
  EXPECT_FALSE(DecodeCells(std::vector<std::uint8_t>(kTileArea, 101), TileEncoding::kRaw));
  EXPECT_FALSE(DecodeCells(std::vector<std::uint8_t>(kTileArea), TileEncoding::kPng));
  EXPECT_FALSE(DecodeCells(std::vector<std::uint8_t>(kTileArea), static_cast<TileEncoding>(9)));
}

TEST(Tile, ATruncatedPngIsRefused) {
  auto bytes = EncodeCells(RandomCells(2), TileEncoding::kPng);
  bytes.resize(40);
  EXPECT_FALSE(DecodeCells(bytes, TileEncoding::kPng));
}

TEST(ReduceTiles, AnObstacleNeverVanishes) {
  TileCells child;
  child.fill(0);
  child[1 * kTileCells + 3] = 100;  // One occupied cell at (3, 1).
  const TileCells parent = ReduceTiles({&child, nullptr, nullptr, nullptr});
  EXPECT_EQ(parent[0 * kTileCells + 1], 100);
  EXPECT_EQ(parent[0], 0);
  EXPECT_EQ(parent[kTileCells / 2], kUnknownCell);  // The neighbour to the right is not there.
}

TEST(ReduceTiles, KnownBeatsUnknownAndFourUnknownStayUnknown) {
  TileCells child;
  child.fill(kUnknownCell);
  child[0] = 7;
  const TileCells parent = ReduceTiles({&child, &child, &child, &child});
  EXPECT_EQ(parent[0], 7);
  EXPECT_EQ(parent[1], kUnknownCell);
}

TEST(ReduceTiles, ChildrenLandInTheirQuarters) {
  std::array<TileCells, 4> children;
  for (std::size_t i = 0; i < 4; ++i) children[i].fill(static_cast<std::uint8_t>(10 * (i + 1)));
  const TileCells parent = ReduceTiles({&children[0], &children[1], &children[2], &children[3]});
  const auto at = [&](int x, int y) { return int{parent[static_cast<std::size_t>(y * kTileCells + x)]}; };
  EXPECT_EQ(at(0, 0), 10);
  EXPECT_EQ(at(127, 0), 20);
  EXPECT_EQ(at(0, 127), 30);
  EXPECT_EQ(at(127, 127), 40);
  EXPECT_EQ(at(63, 63), 10);
  EXPECT_EQ(at(64, 63), 20);
}

TEST(FloorDiv, RoundsDownOnBothSides) {
  EXPECT_EQ(FloorDiv(0, 128), 0);
  EXPECT_EQ(FloorDiv(127, 128), 0);
  EXPECT_EQ(FloorDiv(128, 128), 1);
  EXPECT_EQ(FloorDiv(-1, 128), -1);
  EXPECT_EQ(FloorDiv(-128, 128), -1);
  EXPECT_EQ(FloorDiv(-129, 128), -2);
}

}  // namespace
}  // namespace cairn
