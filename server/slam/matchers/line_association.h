// Finds which lines of two scans belong to the same walls, given a transform between the scans: first by
// their normals, then by the distance of their midpoints and the difference of their slopes. Each line is
// used at most once. Not a search: the transform has to be near the truth; line_lsq.h repeats the association
// while the transform improves.
// Lines in the robot frames of their scans. Stateless, thread-safe, deterministic. Source: thesis B 4.3.2,
// 5.4.3.
#pragma once

#include <span>
#include <vector>

#include "common/geometry/angle.h"
#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/matching/vote_table.h"

namespace cairn::slam {

// The thesis has one limit of the midpoint distance, 0.1 m. Here there are two: from different places
// different parts of a long wall are visible, so its midpoint moves along the wall by far more than 0.1 m,
// but not across it.
struct LineAssociationOptions {
  double min_normal_dot = 0.8;  // Limit of (4.18).
  double max_across_m = 0.1;
  double max_along_m = 1.0;
  double max_slope_rad = Radians(5.0);
  double first_across_m = 0.5;
  double first_slope_rad = Radians(15.0);
  std::int64_t shrinking_rounds = 5;
};
void Visit(OptionVisitor& visitor, LineAssociationOptions& options);

// Returns pairs of indices, ordered by `ref`. `round` counts from 0.
[[nodiscard]] std::vector<LinePair> AssociateLines(std::span<const LineFeature> ref, std::span<const LineFeature> curr,
                                                   const Pose2& T_ref_curr, int round,
                                                   const LineAssociationOptions& options);

}  // namespace cairn::slam
