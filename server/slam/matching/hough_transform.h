// The discrete Hough transform of a scan's points, and what scan matching in the Hough domain takes from it: the
// spectrum over directions, which moving the robot does not change, and correlations of spectra and of columns.
// Directions run over half a turn: (theta + pi, -rho) is the same line. Points in the robot frame of their scan.
// Stateless but for the transform itself, thread-safe, deterministic.
// Source: thesis B 2.2.1, (2.1)-(2.16); Censi, Iocchi, Grisetti, ICRA 2005.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "server/slam/matching/surface_points.h"

namespace cairn::slam {

class HoughTransform {
 public:
  // (2.8), with each point's vote shared between the two nearest bins of rho: the hard bins of the text make the
  // spectrum depend on where the robot stands. Points farther than max_range_m are left out.
  HoughTransform(std::span<const SurfacePoint> points, int directions, double rho_step_m, double max_range_m);

  [[nodiscard]] int directions() const { return directions_; }
  [[nodiscard]] double rho_step_m() const { return rho_step_m_; }
  // The column of one direction, any integer: directions() further on it is reversed. Entry i is rho = (i - half) *
  // step with half = (size - 1) / 2.
  [[nodiscard]] float At(int direction, int rho_bin) const;
  [[nodiscard]] int half() const { return half_; }
  // Energy of every column (2.10), (2.12).
  [[nodiscard]] const std::vector<double>& spectrum() const { return spectrum_; }

 private:
  int directions_;
  double rho_step_m_;
  int half_;                  // Bins from rho = 0 to either end.
  std::vector<float> votes_;  // Direction-major.
  std::vector<double> spectrum_;
};

struct Peak {
  double place = 0.0;  // In bins, between two of them.
  double height = 0.0;
};

// Local maxima, highest first, at most `count`; none lower than `least` times the highest.
[[nodiscard]] std::vector<Peak> PeaksOf(std::span<const double> values, bool circular, int count, double least);

// (2.13): entry k is how alike the spectra are if the current scan is turned by k directions. Circular.
[[nodiscard]] std::vector<double> CorrelateSpectra(const HoughTransform& prev, const HoughTransform& curr);

// (2.14): column `direction` of prev against column `direction - turn` of curr; entry k is a shift of (k - reach) bins.
[[nodiscard]] std::vector<double> CorrelateColumns(const HoughTransform& prev, const HoughTransform& curr,
                                                   int direction, int turn, int centre, int reach);

}  // namespace cairn::slam
