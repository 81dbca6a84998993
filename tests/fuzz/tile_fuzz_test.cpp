#include <gtest/gtest.h>

#include "common/map/image_codec.h"
#include "common/map/tile.h"
#include "tests/fuzz/mutation.h"

namespace cairn {
namespace {

std::string GoodPng() {
  TileCells cells;
  for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = static_cast<std::uint8_t>(i * 7 % 101);
  const auto bytes = EncodeCells(cells, TileEncoding::kPng);
  return {bytes.begin(), bytes.end()};
}

void ExpectCells(const Result<TileCells>& cells) {
  if (!cells) {
    EXPECT_FALSE(cells.error().message.empty());
    return;
  }
  for (const std::uint8_t cell : *cells) ASSERT_TRUE(cell <= 100 || cell == kUnknownCell);
}

TEST(TileFuzz, DamagedTilesAreRefusedOrHoldCells) {
  const std::string good = GoodPng();
  std::mt19937_64 random(3);
  for (int i = 0; i < 3000; ++i) {
    const std::string bad = Mutate(good, random, {"IHDR", "IDAT", "IEND", "PLTE", "tRNS", "\xff\xff\xff\xff"});
    ExpectCells(DecodeCells({bad.begin(), bad.end()}, TileEncoding::kPng));
    ExpectCells(DecodeCells({bad.begin(), bad.end()}, TileEncoding::kRaw));
  }
}

TEST(TileFuzz, NoiseIsRefused) {
  std::mt19937_64 random(4);
  for (int i = 0; i < 500; ++i) {
    std::vector<std::uint8_t> noise(random() % 40'000);
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(random());
    EXPECT_FALSE(DecodeCells(noise, TileEncoding::kPng));
    EXPECT_FALSE(DecodeImage(noise));
  }
}

TEST(TileFuzz, AHeaderOfAnotherSizeIsRefused) {
  const std::string good = GoodPng();
  for (std::size_t at = 16; at < 24; ++at) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x40);
    EXPECT_FALSE(DecodeCells({bad.begin(), bad.end()}, TileEncoding::kPng)) << at;
  }
}

}  // namespace
}  // namespace cairn
