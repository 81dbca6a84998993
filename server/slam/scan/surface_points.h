// The points of a scan with the direction of the surface on which they lie, thinned to a bounded number.
// Point-to-line matching works with them. A point of a smooth surface is the mean of the hits around it: to take single
// hits that are far enough apart would prefer those that noise leads away from the last one. Points are in the robot
// frame of the scan. Stateless, thread-safe. Source: point-to-line metric of Censi, ICRA 2008; thinning after thesis
// C 4.4.3.
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
  // Unit vector towards the sensor; zero if the surface is not smooth.
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  [[nodiscard]] bool smooth() const { return normal != Eigen::Vector2d::Zero(); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.p, self.normal);
    archive.Require(self.p.cwiseAbs().maxCoeff() <= 2e7, "a point of a surface");
  }
};

struct SurfaceOptions {
  double max_range_m = 30.0;  // Farther hits are too sparse to show a surface.
  double min_spacing_m = 0.04;
  double neighbour_span_m = 0.15;
  double max_flatness = 0.12;
  double grazing_gap_m = 2.0;  // Without these two the far ends of corridors hold the robot back.
  double grazing_flat_m = 0.04;
  double span_steps = 3.0;
  std::int64_t skipped_beams = 3;
  std::int64_t grazing_beams = 2;
};
void Visit(OptionVisitor& visitor, SurfaceOptions& options);

// `points` must be PointsOf(scan).
[[nodiscard]] std::vector<SurfacePoint> SurfacePointsOf(std::span<const BeamPoint> points, const Scan& scan,
                                                        const SurfaceOptions& options);

}  // namespace cairn::slam
