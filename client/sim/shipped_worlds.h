// The worlds that come with the program, built into it: flat ones (`building`, `office`, `corridor`, `room`:
// client/sim/worlds/*.world) and ones in space (`hall3d`: *.yaml).
#pragma once

#include <string>
#include <vector>

#include "client/sim/surroundings.h"
#include "client/sim/world.h"
#include "client/sim/world3.h"
#include "common/status.h"

namespace cairn::sim {

[[nodiscard]] std::vector<std::string> ShippedWorldNames();   // Flat.
[[nodiscard]] std::vector<std::string> ShippedWorld3Names();  // In space.

// A shipped world's name, or the path of a world file.
[[nodiscard]] Result<World> OpenWorld(const std::string& name_or_path);
[[nodiscard]] Result<World3> OpenWorld3(const std::string& name_or_path);

// Either kind: a shipped world's name or a file, in space where it ends in .yaml or .yml.
[[nodiscard]] Result<Surroundings> OpenSurroundings(const std::string& name_or_path);

}  // namespace cairn::sim
