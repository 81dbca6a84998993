// Finds the grid cells that the beams of one scan pass or hit, each at most once: a cell that any beam hits
// counts as hit, even if other beams of the same scan pass through it. A hit may be spread over the cells
// around it by a triangular density; a cell then counts with the greatest share that any beam gives it.
// Scratch memory is kept between scans. Not thread-safe.
// Source: thesis A 3.7 (rays after Bresenham 1965).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"

namespace cairn::slam {

struct GridCell {
  int x = 0;
  int y = 0;
};

struct RasterOptions {
  double resolution_m = 0.05;
  double max_ray_m = 25.0;        // Rays are cut here; what is hit farther away is not drawn.
  double no_return_free_m = 0.0;  // How far a beam that hit nothing clears.
  double hit_spread_m = 0.0;      // Where the density of a hit has fallen to zero; 0: a hit is its one cell.
};

class ScanRaster {
 public:
  // Calls visit(cell, hit) for every touched cell, in the order of first touch. `hit` is 0 for a cell that
  // was passed, 1 for one that was hit, and in between for a share of a hit nearby. REQUIRES: the scan passed
  // ValidateScan, and the pose is finite.
  void Rasterise(const Scan& scan, const Pose2& T_map_robot, const RasterOptions& options,
                 const std::function<void(GridCell cell, double hit)>& visit);

 private:
  void MarkRay(GridCell from, GridCell to, bool hit);
  void MarkAround(GridCell hit, double spread_cells);
  void Mark(int x, int y, std::uint8_t mark);

  GridCell low_{};  // Lowest cell of the scratch area.
  int width_ = 0, height_ = 0;
  // Per cell: 0 untouched, 1 passed, larger values a share of a hit, kHit a whole hit.
  std::vector<std::uint8_t> marks_;
  std::vector<std::uint32_t> touched_;
};

}  // namespace cairn::slam
