// The discrete Hough transform of a scan's points, and the functions that scan matching in the Hough domain
// needs: the spectrum over directions, which does not change when the robot moves without turning, and the
// correlations of spectra and of columns.
// Directions cover half a turn: (theta + pi, -rho) is the same line. Points are in the robot frame of their
// scan. Immutable after construction, thread-safe, deterministic.
// Source: thesis B 2.2.1, (2.1)-(2.16); Censi, Iocchi, Grisetti, ICRA 2005.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

class HoughTransform {
 public:
  // (2.8), with each point's vote shared between the two nearest bins of rho. With the hard bins of the
  // thesis the spectrum depends on the robot's position. Points farther than max_range_m are left out.
  HoughTransform(std::span<const SurfacePoint> points, int directions, double rho_step_m, double max_range_m);

  [[nodiscard]] int directions() const { return directions_; }
  [[nodiscard]] double rho_step_m() const { return rho_step_m_; }
  // An element of the column of `direction`, which may be any integer: directions() further on, the same
  // column is reversed. Element i belongs to rho = (i - half) * step with half = (size - 1) / 2.
  [[nodiscard]] float At(int direction, int rho_bin) const;
  [[nodiscard]] int half() const { return half_; }
  // Energy of every column (2.10), (2.12).
  [[nodiscard]] const std::vector<double>& spectrum() const { return spectrum_; }

 private:
  int directions_;
  double rho_step_m_;
  int half_;                  // Number of bins from rho = 0 to either end.
  std::vector<float> votes_;  // Direction-major.
  std::vector<double> spectrum_;
};

struct Peak {
  double place = 0.0;  // Position in bins, interpolated.
  double height = 0.0;
};

// Local maxima, highest first, at most `count`; none lower than `least` times the highest.
[[nodiscard]] std::vector<Peak> PeaksOf(std::span<const double> values, bool circular, int count, double least);

// (2.13): element k is the correlation of the spectra if the current scan is turned by k directions.
// Circular.
[[nodiscard]] std::vector<double> CorrelateSpectra(const HoughTransform& ref, const HoughTransform& curr);

// (2.14): correlates column `direction` of ref with column `direction - turn` of curr; element k belongs to a
// shift of (k - reach) bins.
[[nodiscard]] std::vector<double> CorrelateColumns(const HoughTransform& ref, const HoughTransform& curr, int direction,
                                                   int turn, int centre, int reach);

}  // namespace cairn::slam
