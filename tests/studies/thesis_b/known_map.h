// The walls of a simulated world as a map of lines for LineMatch. Frame: `map`. Plain values; deterministic.
#pragma once

#include <vector>

#include "client/sim/world.h"
#include "common/map/map_lines.h"

namespace cairn::studies {

// Every side of a wall that can be seen: sides inside other walls are left out. Walls must be closed outlines
// or single lines; a single line is seen from both sides. Posts and people are not part of it.
[[nodiscard]] std::vector<MapLine> KnownMapOf(const sim::World& world);

}  // namespace cairn::studies
