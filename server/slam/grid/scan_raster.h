// Finds the grid cells that the beams of one scan pass or hit, each at most once: a cell that any beam hits
// counts as hit, even if other beams of the same scan pass through it. A hit may be spread over the cells
// around it by a triangular density; a cell then counts with the greatest share that any beam gives it.
// Scratch memory is kept between scans. Not thread-safe.
// Source: thesis A 3.7 (rays after Bresenham 1965).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {

struct GridCell {
  int x = 0;
  int y = 0;
};
// The cell of a point, which may have any finite coordinates: beyond 1e9 cells, all points fall into the last cell.
[[nodiscard]] GridCell CellOf(const Eigen::Vector2d& p_map, double resolution_m);

struct RasterOptions {
  double resolution_m = 0.05;
  double max_ray_m = 25.0;        // Rays are cut here; what is hit farther away is not drawn.
  double no_return_free_m = 0.0;  // How far a beam that hit nothing clears.
  double hit_spread_m = 0.0;      // Where the density of a hit has fallen to zero; 0: a hit is its one cell.
};

class ScanRaster {
 public:
  // Cells are visited in pieces of a row, which begin at a multiple of this number.
  static constexpr int kPiece = 16;
  // The mark of a cell: kUntouched, kPassed, kHit, or a share of a hit nearby in between.
  static constexpr std::uint8_t kUntouched = 0, kPassed = 1, kHit = 255;
  using Piece = std::array<std::uint8_t, kPiece>;

  // 0 for a cell that was passed, 1 for one that was hit. REQUIRES: the cell was touched.
  [[nodiscard]] static double HitShare(std::uint8_t mark) {
    return static_cast<double>(mark - kPassed) / (kHit - kPassed);
  }

  // Calls visit(first, marks) for every piece with a touched cell; `first` is its lowest cell, and `marks` a Piece. The
  // order is that of the rows. REQUIRES: the scan passed ValidateScan, and the pose is finite.
  template <typename Visit>
  void Rasterise(const Scan& scan, const Pose2& T_map_robot, const RasterOptions& options, const Visit& visit) {
    MarkAll(scan, T_map_robot, options);
    for (int row = 0; row < height_; ++row) {
      std::uint8_t* marks = marks_.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(width_);
      for (int column = 0; column < width_; column += kPiece) {
        std::array<std::uint64_t, kPiece / 8> words;
        std::memcpy(words.data(), marks + column, kPiece);
        if ((words[0] | words[1]) == 0) continue;
        Piece piece;
        std::memcpy(piece.data(), words.data(), kPiece);
        visit(GridCell{low_.x + column, low_.y + row}, piece);
        std::memset(marks + column, kUntouched, kPiece);
      }
    }
  }

 private:
  struct Ray {
    GridCell to;
    bool hit = false;
  };

  void MarkAll(const Scan& scan, const Pose2& T_map_robot, const RasterOptions& options);
  // Sets rays_.
  void FindRays(const Scan& scan, const Pose2& T_map_laser, const RasterOptions& options);
  void MarkRay(GridCell from, const Ray& ray);
  void MarkAround(GridCell hit, double spread_cells);
  [[nodiscard]] std::uint8_t& MarkOf(int x, int y) {
    return marks_[static_cast<std::size_t>(y - low_.y) * static_cast<std::size_t>(width_) +
                  static_cast<std::size_t>(x - low_.x)];
  }

  BeamDirections directions_;
  GridCell low_{};              // Lowest cell of the scratch area, which contains all rays.
  int width_ = 0, height_ = 0;  // Its size; the width is a multiple of kPiece.
  std::vector<Ray> rays_;
  std::vector<std::uint8_t> marks_;  // By row; all kUntouched between scans.
};

}  // namespace cairn::slam
