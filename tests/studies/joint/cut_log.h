// A log cut into parts of equal numbers of scans, as if several robots had driven them.
#pragma once

#include <vector>

#include "tests/studies/logs.h"

namespace cairn::studies {

// The parts have no relations and no truth, and start at the identity. The odometry sample before a cut belongs to both
// parts, so that the first scans of each have odometry on both sides.
[[nodiscard]] std::vector<StudyLog> CutIntoParts(const StudyLog& log, std::size_t parts);

}  // namespace cairn::studies
