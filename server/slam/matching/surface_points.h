// Points of a scan with the direction of the surface they lie on, thinned to a bounded number: what point-to-line
// matching works with. In the robot frame of the scan. Stateless, thread-safe.
// Source: point-to-line metric of Censi, ICRA 2008; thinning after thesis C 4.4.3.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/sensor/scan.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {

struct SurfacePoint {
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();  // Unit, towards the sensor; zero where the surface is not smooth.
  [[nodiscard]] bool smooth() const { return normal != Eigen::Vector2d::Zero(); }
};

struct SurfaceOptions {
  double max_range_m = 30.0;       // Farther hits are too sparse to show a surface.
  double min_spacing_m = 0.04;     // Between kept points; larger: faster, coarser.
  double neighbour_span_m = 0.15;  // Neighbours within it tell the normal; larger: smoother, rounds corners.
  double neighbour_gap_m = 0.35;   // A larger jump between neighbouring beams ends the surface (grows with range).
  double max_flatness = 0.12;      // Ratio of the spreads across and along above which there is no normal.
  double grazing_gap_m = 2.0;      // Hits of neighbouring beams this far apart can still be on one wall ...
  double grazing_flat_m = 0.04;    // ... if they line up this well. Without, the far ends of corridors hold the robot.
};
void Visit(OptionVisitor& visitor, SurfaceOptions& options);

// `points` are PointsOf(scan).
[[nodiscard]] std::vector<SurfacePoint> SurfacePointsOf(std::span<const BeamPoint> points, const Scan& scan,
                                                        const SurfaceOptions& options);

}  // namespace cairn::slam
