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

// The angle patterns and corner-distance patterns of a scan: how each line is placed relative to the five
// lines that follow it. They do not depend on the pose of the robot, and five equal numbers in a row are
// unlikely by chance. Stateless, thread-safe.
//
// A line's corner is the one that it forms with the first following line that is not parallel to it; a line
// without such a corner has blank entries. The thesis is not clear here (the text names e(i,i+1), Table 3.2
// e(i,i+j)). This reading gives the printed tables their shape: the 8 lines with the slopes of Table 3.13
// have 6 corners, as in Table 3.19, and the 9 lines of Table 3.14 have 7, as in Table 3.20.
// Source: thesis A 3.4.3, Tables 3.1, 3.2, 3.12, 3.18.
// One pattern per line. Lines with an angle below `min_angle_rad` between them count as parallel. In a
// full-turn scan the first lines follow the last one.
[[nodiscard]] std::vector<LinePattern> PatternsOf(const std::vector<LineFeature>& lines, bool full_turn,
                                                  double min_angle_rad);

}  // namespace cairn::slam
