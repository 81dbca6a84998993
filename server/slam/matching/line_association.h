// Which lines of two scans are the same walls, given a transform between them: first by their normals, then by the
// distance of their midpoints and the difference of their slopes; each line is used once. Not a search: the transform
// has to be near; line_lsq.h repeats it while the transform improves.
// Lines in the robot frames of their scans. Stateless, thread-safe, deterministic. Source: thesis B 4.3.2, 5.4.3.
#pragma once

#include <span>
#include <vector>

#include "common/geometry/angle.h"
#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/matching/vote_table.h"

namespace cairn::slam {

// The thesis has one midpoint distance, 0.1 m. A long wall is seen from place to place in different parts, its midpoint
// wanders along it by far more; across the wall there is no such excuse.
struct LineAssociationOptions {
  double min_normal_dot = 0.8;          // NORM_THRESHOLD (4.18).
  double max_across_m = 0.1;            // MP_THRESHOLD, of the distance across the wall ...
  double max_along_m = 1.0;             // ... and along it, beyond half the difference of the lengths.
  double max_slope_rad = Radians(5.0);  // ANGLE_THRESHOLD.
  double first_across_m = 0.5;          // The gates start this wide and reach the values above ...
  double first_slope_rad = Radians(15.0);
  std::int64_t shrinking_rounds = 5;  // ... after so many rounds. 0: the thesis.
};
void Visit(OptionVisitor& visitor, LineAssociationOptions& options);

// Pairs by index, ordered by `prev`; `round` counts from 0.
[[nodiscard]] std::vector<LinePair> AssociateLines(std::span<const LineFeature> prev, std::span<const LineFeature> curr,
                                                   const Pose2& T_prev_curr, int round,
                                                   const LineAssociationOptions& options);

}  // namespace cairn::slam
