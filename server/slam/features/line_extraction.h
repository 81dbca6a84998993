// Split-and-merge line extraction from one scan, in the robot frame of the scan. Not a matcher: it uses a
// single scan. Thresholds that depend on the density of the beams follow the scan's angular resolution, so
// that scans of 180 to 1,081 beams over 90 to 360 degrees are treated alike; a full-turn scan has no seam.
// Stateless, thread-safe, deterministic.
// Source: thesis A 3.3 (steps 1-4), equations (3-3)..(3-9); end classes 3.4.1, (3-10), (3-11).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/sensor/scan.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {

struct LineOptions {
  // Step 1, clusters. Two neighbouring hits belong together while their ranges differ by at most
  // jump + range * step / tan(grazing): the second term is what a wall seen under the angle `grazing` shows.
  double jump_m = 0.10;
  double grazing_rad = Radians(10.0);
  double max_gap_rad = Radians(2.5);

  // Step 3, splitting. A point farther than this from its line splits it: base + per_m * range.
  double split_m = 0.04;  // Below 3 sigma of the ranges walls fall apart.
  double split_per_m = 0.003;

  // Step 4, merging and lengthening.
  double merge_angle_rad = Radians(8.0);
  double occlusion_rad = Radians(9.0);
  double occlusion_m = 1.0;

  // Step 4, deletion. A line needs min_length and the number of points a wall of that length would get at its range and
  // slope, but at least min_points and at most max_points_needed.
  double min_length_m = 0.30;
  std::int64_t min_points = 4;
  std::int64_t max_points_needed = 8;
  double max_deviation_m = 0.04;
  double min_aspect = 12.0;

  // Step 4, correction of a short line between two parallel ones: turned perpendicular when its own slope is too
  // uncertain to contradict that (3 sigma).
  std::int64_t correct_below_points = 8;
  double range_sigma_m = 0.015;  // Also keeps the weights finite on perfect data.

  // End classes.
  double end_gap_m = 0.10;
  double corner_incidence_rad = Radians(20.0);
  double end_uncertainty_m = 0.60;
};
void Visit(OptionVisitor& visitor, LineOptions& options);

// `points` must be PointsOf(scan), possibly thinned, in the order of the beams. The lines are returned in
// anticlockwise order; the result is empty if the scan has none.
[[nodiscard]] std::vector<LineFeature> ExtractLines(std::span<const BeamPoint> points, const Scan& scan,
                                                    const LineOptions& options);

}  // namespace cairn::slam
