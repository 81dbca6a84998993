// The angle and corner-distance patterns of a scan: how each line stands to the five that follow it. They do not depend
// on where the robot stands, and five agreeing numbers in a row are hard to meet by chance. Stateless, thread-safe.
//
// A line's corner is the one with the first following line that is not parallel to it; a line without such has blanks.
// This reading (the text names e(i,i+1), Table 3.2 e(i,i+j)) is the one that gives the printed tables their shape: 8
// lines with slopes of Table 3.13 have 6 corners, as Table 3.19 has, and 9 of Table 3.14 have 7, as Table 3.20.
// Source: thesis A 3.4.3, Tables 3.1, 3.2, 3.12, 3.18.
#pragma once

#include <vector>

#include "server/slam/features/line_feature.h"

namespace cairn::slam {

// One pattern per line; `min_angle_rad` tells parallel from crossing. In a full-turn scan patterns go round.
[[nodiscard]] std::vector<LinePattern> PatternsOf(const std::vector<LineFeature>& lines, bool full_turn,
                                                  double min_angle_rad);

}  // namespace cairn::slam
