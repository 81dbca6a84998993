#include "client/web/fragment_picture.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "common/map/occupancy_image.h"

namespace cairn::web {
namespace {

constexpr std::uint32_t kCoarsestLevel = kPyramidLevels - 1;

std::uint8_t CellAt(const OccupancyImage& image, int column, int row) {
  return image
      .cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(column)];
}

// The part that holds all known cells; 0 x 0 where none is known.
OccupancyImage KnownPart(const OccupancyImage& image) {
  int left = image.width, right = -1, bottom = image.height, top = -1;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      if (CellAt(image, column, row) == kUnknownCell) continue;
      left = std::min(left, column);
      right = std::max(right, column);
      bottom = std::min(bottom, row);
      top = std::max(top, row);
    }
  }
  OccupancyImage part;
  part.resolution_m = image.resolution_m;
  if (right < 0) return part;
  part.T_map_origin.x = image.T_map_origin.x + left * image.resolution_m;
  part.T_map_origin.y = image.T_map_origin.y + bottom * image.resolution_m;
  part.width = right - left + 1;
  part.height = top - bottom + 1;
  part.cells.reserve(static_cast<std::size_t>(part.width) * static_cast<std::size_t>(part.height));
  for (int row = bottom; row <= top; ++row) {
    for (int column = left; column <= right; ++column) part.cells.push_back(CellAt(image, column, row));
  }
  return part;
}

// With cells twice as large. As in the pyramid of tiles, each is the largest of its known cells, so that no wall
// vanishes.
OccupancyImage Halved(const OccupancyImage& image) {
  OccupancyImage half;
  half.resolution_m = 2.0 * image.resolution_m;
  half.T_map_origin = image.T_map_origin;
  half.width = (image.width + 1) / 2;
  half.height = (image.height + 1) / 2;
  half.cells.assign(static_cast<std::size_t>(half.width) * static_cast<std::size_t>(half.height), kUnknownCell);
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const std::uint8_t cell = CellAt(image, column, row);
      std::uint8_t& of_four = half.cells[static_cast<std::size_t>(row / 2) * static_cast<std::size_t>(half.width) +
                                         static_cast<std::size_t>(column / 2)];
      if (cell != kUnknownCell && (of_four == kUnknownCell || cell > of_four)) of_four = cell;
    }
  }
  return half;
}

int LongerSide(const OccupancyImage& image) {
  return std::max(image.width, image.height);
}

Result<OccupancyImage> KnownPartOfLevel(const AskRobotTiles& ask, std::uint32_t level, double level0_resolution_m) {
  auto tiles = ask(level);
  if (!tiles) return tl::unexpected(tiles.error());
  for (Tile& tile : *tiles) tile.key.level = 0;  // Of a map with larger cells.
  return AssembleTiles(*tiles, level0_resolution_m * static_cast<double>(1U << level)).map(KnownPart);
}

}  // namespace

Result<FragmentPicture> DrawFragment(const AskRobotTiles& ask, double level0_resolution_m, Theme theme) {
  auto image = KnownPartOfLevel(ask, kCoarsestLevel, level0_resolution_m);
  if (!image) return tl::unexpected(image.error());
  std::uint32_t level = kCoarsestLevel;
  for (int side = 2 * LongerSide(*image); level > 0 && side <= kMostFragmentPixels; side *= 2) --level;
  if (level < kCoarsestLevel && image->width > 0) {
    image = KnownPartOfLevel(ask, level, level0_resolution_m);
    if (!image) return tl::unexpected(image.error());
  }
  if (image->width == 0) return Fail(StatusCode::kNotFound, "the robot has drawn nothing yet");
  // A map may be too large also at the coarsest level, or have grown since that one was asked for.
  while (LongerSide(*image) > kMostFragmentPixels) *image = Halved(*image);
  auto png = DrawMap(*image, theme);
  if (!png) return tl::unexpected(png.error());
  const Pose2& low = image->T_map_origin;
  return FragmentPicture{.x_min = low.x,
                         .y_min = low.y,
                         .x_max = low.x + image->width * image->resolution_m,
                         .y_max = low.y + image->height * image->resolution_m,
                         .png = std::move(*png)};
}

}  // namespace cairn::web
