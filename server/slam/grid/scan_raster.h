// The grid cells one scan says something about, each at most once: a cell that any beam hits counts as hit even where
// other beams of the same scan pass through it. Scratch memory is kept between scans. Not thread-safe.
// Source: thesis A 3.7 (Bresenham 1965 rays).
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
};

class ScanRaster {
 public:
  // Calls visit(cell, hit) for every touched cell, in the order of first touch. The scan is validated, the pose finite.
  void Rasterise(const Scan& scan, const Pose2& T_map_robot, const RasterOptions& options,
                 const std::function<void(GridCell cell, bool hit)>& visit);

 private:
  void MarkRay(GridCell from, GridCell to, bool hit);
  void Mark(int x, int y, std::uint8_t mark);

  GridCell low_{};  // Corner of the scratch box.
  int width_ = 0, height_ = 0;
  std::vector<std::uint8_t> marks_;  // 0 untouched, 1 free, 2 hit.
  std::vector<std::uint32_t> touched_;
};

}  // namespace cairn::slam
