// The angle patterns and corner-distance patterns of a scan: how each line is placed relative to the five
// lines that follow it. They do not depend on the pose of the robot, and five equal numbers in a row are
// unlikely by chance. Stateless, thread-safe.
//
// A line's corner is the one that it forms with the first following line that is not parallel to it; a line
// without such a corner has blank entries. The thesis is not clear here (the text names e(i,i+1), Table 3.2
// e(i,i+j)). This reading gives the printed tables their shape: the 8 lines with the slopes of Table 3.13
// have 6 corners, as in Table 3.19, and the 9 lines of Table 3.14 have 7, as in Table 3.20.
// Source: thesis A 3.4.3, Tables 3.1, 3.2, 3.12, 3.18.
#pragma once

#include <vector>

#include "server/slam/features/line_feature.h"

namespace cairn::slam {

// One pattern per line. Lines with an angle below `min_angle_rad` between them count as parallel. In a
// full-turn scan the first lines follow the last one.
[[nodiscard]] std::vector<LinePattern> PatternsOf(const std::vector<LineFeature>& lines, bool full_turn,
                                                  double min_angle_rad);

}  // namespace cairn::slam
