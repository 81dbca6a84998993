// Opens worlds: those that are built into the program (client/sim/worlds/*.yaml) by name, others by the path of their
// file. kNotFound if there is neither; the message lists the shipped names. Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "client/sim/scene.h"
#include "client/sim/world.h"
#include "client/sim/world3.h"
#include "common/status.h"

namespace cairn::sim {

// Names of the shipped worlds of both kinds.
[[nodiscard]] std::vector<std::string> ShippedWorldNames();

[[nodiscard]] Result<World> OpenWorld(const std::string& name_or_path);                // A flat world.
[[nodiscard]] Result<World3> OpenWorld3(const std::string& name_or_path);              // A world in space.
[[nodiscard]] Result<Surroundings> OpenSurroundings(const std::string& name_or_path);  // Either kind.

}  // namespace cairn::sim
