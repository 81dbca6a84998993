// The own map of a robot that is not joined yet, as one small picture.
#include "client/web/fragment_picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "common/map/image_codec.h"
#include "tests/must.h"

namespace cairn::web {
namespace {

using test::Must;
using ::testing::ElementsAre;

constexpr double kResolutionM = 0.05;

// A wall along the lowest row of a map, in cells of the finest level, and free cells above it. Its tiles are made for
// each level that is asked for.
class OwnMap {
 public:
  OwnMap(int left, int bottom, int width, int height) : left_(left), bottom_(bottom), width_(width), height_(height) {}

  [[nodiscard]] AskRobotTiles Ask() {
    return [this](std::uint32_t level) -> Result<std::vector<Tile>> {
      levels_.push_back(level);
      return TilesOf(static_cast<int>(level));
    };
  }
  [[nodiscard]] const std::vector<std::uint32_t>& levels() const { return levels_; }  // That were asked for.

 private:
  [[nodiscard]] std::vector<Tile> TilesOf(int level) const {
    const int cell = 1 << level;
    const int x_min = FloorDiv(left_, cell), x_max = FloorDiv(left_ + width_ - 1, cell);
    const int y_min = FloorDiv(bottom_, cell), y_max = FloorDiv(bottom_ + height_ - 1, cell);
    std::vector<Tile> tiles;
    for (int ty = FloorDiv(y_min, kTileCells); ty <= FloorDiv(y_max, kTileCells); ++ty) {
      for (int tx = FloorDiv(x_min, kTileCells); tx <= FloorDiv(x_max, kTileCells); ++tx) {
        Tile tile{.key = {level, tx, ty}, .version = 1, .encoding = TileEncoding::kRaw, .bytes = {}};
        for (int row = ty * kTileCells; row < (ty + 1) * kTileCells; ++row) {
          for (int column = tx * kTileCells; column < (tx + 1) * kTileCells; ++column) {
            const bool known = column >= x_min && column <= x_max && row >= y_min && row <= y_max;
            tile.bytes.push_back(!known ? kUnknownCell : row == y_min ? 100 : 0);
          }
        }
        tiles.push_back(std::move(tile));
      }
    }
    return tiles;
  }

  const int left_, bottom_, width_, height_;
  std::vector<std::uint32_t> levels_;
};

RasterImage Decoded(const FragmentPicture& picture) {
  return Must(DecodeImage({picture.png.begin(), picture.png.end()}));
}

TEST(FragmentPicture, ASmallMapInItsFinestCells) {
  OwnMap map(-40, 10, 100, 60);
  const FragmentPicture picture = Must(DrawFragment(map.Ask(), kResolutionM, Theme::kLight));
  EXPECT_THAT(map.levels(), ElementsAre(3U, 0U));
  EXPECT_NEAR(picture.x_min, -2.0, 1e-9);
  EXPECT_NEAR(picture.y_min, 0.5, 1e-9);
  EXPECT_NEAR(picture.x_max, 3.0, 1e-9);
  EXPECT_NEAR(picture.y_max, 3.5, 1e-9);
  const RasterImage image = Decoded(picture);
  EXPECT_EQ(image.width, 100) << "nothing unknown around it";
  EXPECT_EQ(image.height, 60);
  const auto blue = [&](int row, int column) {
    return image.samples[static_cast<std::size_t>((row * image.width + column) * 4)];
  };
  EXPECT_EQ(blue(0, 50), 255) << "the highest row first";
  EXPECT_LT(blue(59, 50), 80) << "the wall";
}

TEST(FragmentPicture, ALargerMapInCoarserCells) {
  OwnMap map(0, 0, 1500, 300);
  const FragmentPicture picture = Must(DrawFragment(map.Ask(), kResolutionM, Theme::kDark));
  EXPECT_THAT(map.levels(), ElementsAre(3U, 2U));
  const RasterImage image = Decoded(picture);
  EXPECT_EQ(image.width, 375);
  EXPECT_EQ(image.height, 75);
  EXPECT_NEAR(picture.x_max - picture.x_min, 75.0, 1e-9);
}

TEST(FragmentPicture, IsNeverLargerThanItMayBe) {
  OwnMap map(0, 0, 9000, 800);
  const FragmentPicture picture = Must(DrawFragment(map.Ask(), kResolutionM, Theme::kLight));
  EXPECT_THAT(map.levels(), ElementsAre(3U));
  const RasterImage image = Decoded(picture);
  EXPECT_EQ(image.width, 282) << "1,125 cells of the coarsest level, halved twice";
  EXPECT_EQ(image.height, 25);
  EXPECT_LE(std::max(image.width, image.height), kMostFragmentPixels);
  EXPECT_LT(image.samples[static_cast<std::size_t>(24 * 282 + 100) * 4], 80) << "the wall has not vanished";
}

TEST(FragmentPicture, NothingDrawnAndNoAnswer) {
  const auto empty = [](std::uint32_t) -> Result<std::vector<Tile>> { return std::vector<Tile>(); };
  const auto nothing = DrawFragment(empty, kResolutionM, Theme::kLight);
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().code, StatusCode::kNotFound);
  const auto silent = [](std::uint32_t) -> Result<std::vector<Tile>> {
    return Fail(StatusCode::kDeadlineExceeded, "no answer");
  };
  const auto none = DrawFragment(silent, kResolutionM, Theme::kLight);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, StatusCode::kDeadlineExceeded);
  const auto damaged = [](std::uint32_t level) -> Result<std::vector<Tile>> {
    return std::vector<Tile>{{.key = {static_cast<int>(level), 0, 0}, .encoding = TileEncoding::kPng, .bytes = {1, 2}}};
  };
  EXPECT_FALSE(DrawFragment(damaged, kResolutionM, Theme::kLight));
}

}  // namespace
}  // namespace cairn::web
