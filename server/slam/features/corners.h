// Corners between the lines of one scan: real ones where two following lines meet, virtual ones where the extensions of
// two lines would. Virtual corners are kept for following lines and between any two long lines: those are what the
// three categories of the thesis need (long lines; all real; all). Robot frame. Stateless, thread-safe.
// Source: thesis A 3.4.2, Figure 3.12.
#pragma once

#include <optional>
#include <vector>

#include "common/geometry/angle.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/line_feature.h"

namespace cairn::slam {

struct CornerOptions {
  double min_angle_rad = Radians(25.0);  // Flatter pairs meet too vaguely to say where (3.5.8, implementation notes).
  double real_gap_m = 0.15;              // Ends this close, plus two beams' spacing there, meet. Larger: more corners,
                                         // less exact ones.
  double long_line_m = 1.0;              // Lines from this length on are long (category 1).
  double max_distance_m = 30.0;          // Virtual corners farther from the robot are dropped.
};
void Visit(OptionVisitor& visitor, CornerOptions& options);

// Where two lines' extensions meet; nothing where they are flatter to each other than `min_angle_rad`.
[[nodiscard]] std::optional<Eigen::Vector2d> MeetingPoint(const LineFeature& a, const LineFeature& b,
                                                          double min_angle_rad);

// `features.lines`, `angle_step_rad` and `full_turn` must be set. Ordered by line_a, then line_b.
[[nodiscard]] std::vector<CornerFeature> ExtractCorners(const ScanFeatures& features, const CornerOptions& options);

}  // namespace cairn::slam
