// The normal distributions transform of one scan: the plane is divided into cells, and each holds the normal
// distribution of its points. Four grids of equal cells, shifted by half a cell, overlap, so that every point
// is evaluated in four cells and cell boundaries matter less; a density is the sum over the four, 0..4. Not
// an occupancy grid: it describes where points are likely to be measured.
// Frame: that of the points. Metres. Immutable after construction, so thread-safe.
// Source: Biber and Strasser, IROS 2003; thesis C 2.3.3 (2.11)-(2.19).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct NdtMapOptions {
  double cell_m = 1.0;  // Thesis C 5.1.3 takes 4 m in a mine.
  std::int64_t min_points = 3;
  double min_flatness = 1e-3;
};
void Visit(OptionVisitor& visitor, NdtMapOptions& options);

// Score of points at one pose, with its exact derivatives in (x, y, theta) of the pose. At the boundaries
// between cells the score has small jumps, which the derivatives do not include.
struct NdtDerivatives {
  double score = 0.0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  int inliers = 0;  // Points within three sigma of one of their four cells.
};

class NdtMap {
 public:
  // Points that are not finite or farther than 512 half cells from the mean of all are left out.
  NdtMap(std::span<const Eigen::Vector2d> points, const NdtMapOptions& options);

  // Sum of the densities of a point's four cells (2.13); a cell without a distribution counts 0.
  [[nodiscard]] double Density(const Eigen::Vector2d& p) const;
  // (2.15): the sum of the densities of all points mapped by T, to six digits. It uses single precision and
  // computes four exponentials at once, because matching by evolution spends most of its time here.
  // Derivatives() gives the same number in double precision.
  [[nodiscard]] double Score(std::span<const Eigen::Vector2d> points, const Pose2& T_map_points) const;
  [[nodiscard]] NdtDerivatives Derivatives(std::span<const Eigen::Vector2d> points, const Pose2& T_map_points) const;
  [[nodiscard]] bool empty() const { return quads_.empty(); }

 private:
  // The four distributions that overlap in one half cell. For a distribution that does not exist, `present`
  // is 0.
  struct Quad {
    Eigen::Array4d mean_x = Eigen::Array4d::Zero();
    Eigen::Array4d mean_y = Eigen::Array4d::Zero();
    Eigen::Array4d B_xx = Eigen::Array4d::Zero();  // Inverse covariance.
    Eigen::Array4d B_xy = Eigen::Array4d::Zero();
    Eigen::Array4d B_yy = Eigen::Array4d::Zero();
    Eigen::Array4d present = Eigen::Array4d::Zero();
  };
  // The same for Score(): means relative to the corner of the half cell, so that single precision loses no
  // digits, and -B/2. A distribution that does not exist is placed so far away that its density is 0.
  struct ShortQuad {
    Eigen::Array4f mean_x, mean_y, xx, xy, yy;
  };
  struct Place {
    int column, row;
  };
  // Index of the half cell's quad; -1 outside, or if a coordinate is not a number.
  [[nodiscard]] std::int32_t QuadIndex(double x, double y, Place& place) const;
  [[nodiscard]] const Quad* QuadAt(double x, double y) const;
  void Shorten();
  void AddGrid(std::span<const Eigen::Vector2d> points, int grid, const NdtMapOptions& options);

  double half_m_;
  double per_half_m_;
  double x_first_ = 0.0, y_first_ = 0.0;  // Corner of half cell (0, 0).
  int columns_ = 0, rows_ = 0;            // In half cells.
  std::vector<std::int32_t> index_;       // Index of each half cell's quad; -1 if there is none.
  std::vector<Quad> quads_;
  std::vector<ShortQuad> short_quads_;  // One per quad.
};

}  // namespace cairn::slam
