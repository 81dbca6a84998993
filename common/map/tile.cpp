#include "common/map/tile.h"

#include <algorithm>
#include <string>

#include "common/map/png_codec.h"

namespace cairn {
namespace {

// Other values than 0..100 and unknown are refused: programs that draw or plan rely on it.
bool IsCell(std::uint8_t value) {
  return value <= 100 || value == kUnknownCell;
}

Result<TileCells> ToCells(const std::vector<std::uint8_t>& values) {
  if (!std::all_of(values.begin(), values.end(), IsCell)) {
    return Fail(StatusCode::kInvalidArgument, "tile holds a cell that is neither 0..100 nor unknown");
  }
  TileCells cells;
  std::copy(values.begin(), values.end(), cells.begin());
  return cells;
}

}  // namespace

std::vector<std::uint8_t> EncodeCells(const TileCells& cells, TileEncoding encoding) {
  std::vector<std::uint8_t> raw(cells.begin(), cells.end());
  if (encoding == TileEncoding::kRaw) return raw;
  const RasterImage image{kTileCells, kTileCells, 1, std::move(raw)};
  // Fails only without memory, where going on makes no sense.
  return EncodePng(image).value();
}

Result<TileCells> DecodeCells(const std::vector<std::uint8_t>& bytes, TileEncoding encoding) {
  switch (encoding) {
    case TileEncoding::kRaw:
      if (bytes.size() != kTileArea) {
        return Fail(StatusCode::kInvalidArgument, "raw tile of " + std::to_string(bytes.size()) + " bytes");
      }
      return ToCells(bytes);
    case TileEncoding::kPng: {
      const auto samples = DecodeGreyPng(bytes, {kTileCells, kTileCells});
      if (!samples) return tl::unexpected(samples.error());
      return ToCells(*samples);
    }
  }
  return Fail(StatusCode::kInvalidArgument, "unknown tile encoding " + std::to_string(static_cast<int>(encoding)));
}

TileCells ReduceTiles(const std::array<const TileCells*, 4>& children) {
  constexpr int kHalf = kTileCells / 2;
  TileCells parent;
  parent.fill(kUnknownCell);
  for (int quarter = 0; quarter < 4; ++quarter) {
    const TileCells* child = children[static_cast<std::size_t>(quarter)];
    if (child == nullptr) continue;
    const int left = (quarter % 2) * kHalf, bottom = (quarter / 2) * kHalf;
    for (int y = 0; y < kTileCells; ++y) {
      for (int x = 0; x < kTileCells; ++x) {
        const std::uint8_t cell = (*child)[static_cast<std::size_t>(y * kTileCells + x)];
        if (cell == kUnknownCell) continue;
        auto& coarse = parent[static_cast<std::size_t>((bottom + y / 2) * kTileCells + left + x / 2)];
        coarse = coarse == kUnknownCell ? cell : std::max(coarse, cell);
      }
    }
  }
  return parent;
}

}  // namespace cairn
