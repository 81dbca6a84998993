// Split-and-merge line extraction from one scan. Not a matcher: looks at a single scan, in its robot frame.
// Lengths that depend on how densely the beams fall follow the scan's angular resolution, so 180 to 1,081 beams over 90
// to 360 degrees behave alike; a full-turn scan has no seam. Stateless, thread-safe, deterministic.
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
  double jump_m = 0.10;                // Larger joins things that stand apart; smaller breaks rough walls.
  double grazing_rad = Radians(10.0);  // Smaller keeps walls whole that are seen edge-on, and joins more.
  double max_gap_rad = Radians(2.5);   // Invalid beams inside one cluster, at least 2 beams.

  // Step 3, splitting. A point farther than this from its line splits it: base + per_m * range.
  double split_m = 0.04;  // Larger smooths over steps and posts; below 3 sigma of the ranges walls fall apart.
  double split_per_m = 0.003;

  // Step 4, merging and lengthening.
  double merge_angle_rad = Radians(8.0);  // Neighbours steeper to each other than this are never one line.
  double occlusion_rad = Radians(9.0);    // Points nearer than the line that may interrupt it, as an angle, at least
                                          // 3 beams; larger bridges wider posts.
  double occlusion_m = 1.0;               // ... and as a length along the line.

  // Step 4, deletion. A line needs min_length and the number of points a wall of that length would get at its range and
  // slope, but at least min_points and at most max_points_needed.
  double min_length_m = 0.30;  // Larger keeps only walls; smaller lets clutter in.
  std::int64_t min_points = 4;
  std::int64_t max_points_needed = 8;
  double max_deviation_m = 0.04;  // RMS of points about their line; larger lets foliage and people in.
  double min_aspect = 12.0;       // Length over deviation; larger drops short rough lines.

  // Step 4, correction of a short line between two parallel ones: turned perpendicular when its own slope is too
  // uncertain to contradict that (3 sigma).
  std::int64_t correct_below_points = 8;  // 0 never corrects.
  double range_sigma_m = 0.015;           // Noise of one range; also keeps weights finite on perfect data.

  // End classes.
  double end_gap_m = 0.10;                      // What follows within this (plus the beams' spacing) closes an end.
  double corner_incidence_rad = Radians(20.0);  // Walls across an end seen flatter than this may be taken for far ones.
  double end_uncertainty_m = 0.60;  // An end known worse than this, because beams fall so far apart, is open.
};
void Visit(OptionVisitor& visitor, LineOptions& options);

// `points` are PointsOf(scan), possibly thinned, in the order of its beams. Lines anticlockwise. Empty where the scan
// holds none.
[[nodiscard]] std::vector<LineFeature> ExtractLines(std::span<const BeamPoint> points, const Scan& scan,
                                                    const LineOptions& options);

}  // namespace cairn::slam
