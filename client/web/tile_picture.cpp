#include "client/web/tile_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "common/map/png_codec.h"

namespace cairn::web {
namespace {

using Colour = std::array<double, 3>;  // Blue, green, red.

struct Palette {
  Colour free;
  Colour occupied;
};

Palette PaletteOf(Theme theme) {
  if (theme == Theme::kDark) return {.free = {62, 50, 42}, .occupied = {244, 234, 226}};
  return {.free = {255, 255, 255}, .occupied = {46, 34, 24}};
}

Result<std::string> BytesOf(const RasterImage& image) {
  return EncodePng(image).map([](const auto& png) { return std::string(png.begin(), png.end()); });
}

// `cells`: row by row from the lowest one.
Result<std::string> DrawCells(std::span<const std::uint8_t> cells, int width, int height, Theme theme) {
  const Palette palette = PaletteOf(theme);
  const auto columns = static_cast<std::size_t>(width);
  RasterImage image{.width = width, .height = height, .channels = 4, .samples = {}};
  image.samples.resize(4 * cells.size());
  auto to = image.samples.begin();
  for (auto row = static_cast<std::size_t>(height); row-- > 0;) {
    for (std::size_t column = 0; column < columns; ++column, to += 4) {
      const std::uint8_t cell = cells[row * columns + column];
      if (cell == kUnknownCell) continue;  // Transparent.
      const double share = cell / 100.0;
      for (std::size_t i = 0; i < 3; ++i) {
        const double value = palette.free[i] + share * (palette.occupied[i] - palette.free[i]);
        to[static_cast<std::ptrdiff_t>(i)] = static_cast<std::uint8_t>(std::lround(value));
      }
      to[3] = 255;
    }
  }
  return BytesOf(image);
}

}  // namespace

Result<std::string> DrawTile(const Tile& tile, Theme theme) {
  const auto cells = DecodeCells(tile.bytes, tile.encoding);
  if (!cells) return tl::unexpected(cells.error());
  return DrawCells(*cells, kTileCells, kTileCells, theme);
}

Result<std::string> DrawMap(const OccupancyImage& map, Theme theme) {
  return DrawCells(map.cells, map.width, map.height, theme);
}

Result<std::string> DrawDisagreement(const OccupancyImage& image) {
  constexpr std::uint8_t kHalf = 50;
  constexpr std::array<std::uint8_t, 4> kRed = {48, 40, 214, 230};
  const auto width = static_cast<std::size_t>(image.width), height = static_cast<std::size_t>(image.height);
  RasterImage picture{.width = image.width, .height = image.height, .channels = 4, .samples = {}};
  picture.samples.resize(4 * width * height);
  auto to = picture.samples.begin();
  for (std::size_t row = height; row-- > 0;) {
    for (std::size_t column = 0; column < width; ++column, to += 4) {
      const std::uint8_t cell = image.cells[row * width + column];
      if (cell != kUnknownCell && cell > kHalf) std::ranges::copy(kRed, to);
    }
  }
  return BytesOf(picture);
}

}  // namespace cairn::web
