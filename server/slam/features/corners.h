// Corners between the lines of one scan. A corner is real where two consecutive lines meet, and virtual where
// only their extensions meet. Virtual corners are kept for consecutive lines and for all pairs of long lines,
// because the three categories of the thesis need them (corners of long lines; all real corners; all
// corners). Robot frame. Stateless, thread-safe.
// Source: thesis A 3.4.2, Figure 3.12.
#pragma once

#include <optional>
#include <vector>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/line_feature.h"

namespace cairn::slam {

struct CornerOptions {
  double min_angle_rad = Radians(25.0);  // 3.5.8, implementation notes: flatter pairs do not say where they meet.
  double real_gap_m = 0.15;
  double long_line_m = 1.0;
  double max_distance_m = 30.0;
};
void Visit(OptionVisitor& visitor, CornerOptions& options);

// The point where the extensions of two lines meet; nothing if the angle between the lines is below
// `min_angle_rad`.
[[nodiscard]] std::optional<Eigen::Vector2d> MeetingPoint(const LineFeature& a, const LineFeature& b,
                                                          double min_angle_rad);

// REQUIRES: `features.lines`, `angle_step_rad` and `full_turn` are set. The corners are ordered by line_a,
// then line_b.
[[nodiscard]] std::vector<CornerFeature> ExtractCorners(const ScanFeatures& features, const CornerOptions& options);

}  // namespace cairn::slam
