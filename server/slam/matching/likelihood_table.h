// A raster of how likely a point is to be a hit of the reference scan: 255 on its surfaces, falling with the square of
// the distance to 0 at the table's reach. Surfaces are drawn as strokes between neighbouring hits, so that sparse far
// walls have no holes. With a coarse twin whose every cell holds the largest value of the block of cells that starts
// there: the sum of coarse values bounds every sum of fine ones in the block.
// Frame of the reference scan's robot. Immutable once made, then read from any thread.
// Source: Olson, ICRA 2009, III.B (lookup tables, max-decimation); block maxima at every cell as in Hess 2016.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/matching/surface_points.h"

namespace cairn::slam {

class LikelihoodTable {
 public:
  // Points beyond max_range_m are left out; `margin_m` is kept free around the rest; `block`: cells of a coarse block.
  LikelihoodTable(std::span<const SurfacePoint> points, double cell_m, double reach_m, double max_range_m,
                  double margin_m, int block);

  [[nodiscard]] double cell_m() const { return cell_m_; }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  // Cell of a point; may lie outside.
  [[nodiscard]] Eigen::Vector2i CellOf(const Eigen::Vector2d& p) const {
    return {static_cast<int>(std::floor((p.x() - origin_.x()) / cell_m_)),
            static_cast<int>(std::floor((p.y() - origin_.y()) / cell_m_))};
  }
  // Row-major.
  [[nodiscard]] const std::vector<std::uint8_t>& fine() const { return fine_; }
  [[nodiscard]] const std::vector<std::uint8_t>& coarse() const { return coarse_; }

 private:
  void Stamp(const Eigen::Vector2d& p, const std::vector<std::uint8_t>& kernel, int radius);

  double cell_m_;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();  // Lower left corner.
  int columns_ = 0;
  int rows_ = 0;
  std::vector<std::uint8_t> fine_, coarse_;
};

}  // namespace cairn::slam
