// A raster of the likelihood that a point is a hit of the reference scan: 255 on its surfaces, falling with
// the square of the distance to 0 at the table's reach. Surfaces are drawn as strokes between neighbouring
// hits, so that sparse far walls have no holes. A second, coarse raster holds in every cell the maximum over
// the block of cells that starts there: a sum of coarse values is an upper bound of every sum of fine values
// within the block.
// Frame: the robot frame of the reference scan. Immutable after construction; any thread may read.
// Source: Olson, ICRA 2009, III.B (lookup tables, max-decimation); block maxima at every cell as in Hess et
// al. 2016.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

class LikelihoodTable {
 public:
  // Points beyond max_range_m are left out. `margin_m` is the free border around the other points, `block`
  // the side of a coarse block in cells.
  LikelihoodTable(std::span<const SurfacePoint> points, double cell_m, double reach_m, double max_range_m,
                  double margin_m, int block);

  [[nodiscard]] double cell_m() const { return cell_m_; }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return rows_; }
  // The cell of a point, which may lie outside of the raster.
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
