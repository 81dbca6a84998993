// The worlds that come with the program, built into it: `building`, `office`, `corridor`, `room`
// (client/sim/worlds/*.world).
#pragma once

#include <string>
#include <vector>

#include "client/sim/world.h"
#include "common/status.h"

namespace cairn::sim {

[[nodiscard]] std::vector<std::string> ShippedWorldNames();

// A shipped world's name, or the path of a world file.
[[nodiscard]] Result<World> OpenWorld(const std::string& name_or_path);

}  // namespace cairn::sim
