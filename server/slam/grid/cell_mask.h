// A set of cells of one chunk: one bit for each. A plain value.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/map/tile.h"
#include "server/slam/grid/scan_raster.h"

namespace cairn::slam {

class CellMask {
 public:
  // `cell`: its index in the chunk (IndexInChunk).
  [[nodiscard]] bool Has(std::size_t cell) const {
    return (pieces_[cell / ScanRaster::kPiece] >> (cell % ScanRaster::kPiece) & 1U) != 0;
  }
  // Adds the touched cells of a piece. REQUIRES: `first`, the index of the lowest of them, is a multiple of kPiece.
  void AddTouched(std::size_t first, const ScanRaster::Piece& marks) {
    unsigned touched = 0;
    for (std::size_t i = 0; i < marks.size(); ++i) touched |= (marks[i] != ScanRaster::kUntouched ? 1U : 0U) << i;
    pieces_[first / ScanRaster::kPiece] |= static_cast<std::uint16_t>(touched);
  }
  CellMask& operator|=(const CellMask& other) {
    for (std::size_t i = 0; i < pieces_.size(); ++i) pieces_[i] |= other.pieces_[i];
    return *this;
  }

 private:
  static_assert(ScanRaster::kPiece == 16 && kTileArea % ScanRaster::kPiece == 0);
  std::array<std::uint16_t, kTileArea / ScanRaster::kPiece> pieces_{};
};

}  // namespace cairn::slam
