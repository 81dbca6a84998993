// Reads worlds from YAML; client/sim/README.md explains the format. Nothing is guessed: a key or a value that the
// format does not have is an error (kInvalidArgument) of the form "SOURCE:LINE:COLUMN: what is wrong".
// Memory is bounded for every text: there are limits on its length, on coordinates, on list elements (also those that
// YAML aliases repeat), on segments and on rectangles. Stateless and thread-safe.
#pragma once

#include <string>

#include "client/sim/scene.h"
#include "client/sim/world.h"
#include "client/sim/world3.h"
#include "common/status.h"

namespace cairn::sim {

inline constexpr std::size_t kMaxWorldBytes = 1u << 20;  // yaml-cpp needs up to 250 times as much memory.

// A flat world, which says `cairn-world: 1`. `source` names the text in errors.
[[nodiscard]] Result<World> ParseWorld(const std::string& text, const std::string& source);

// A world in space, which says `cairn-world3: 1`.
[[nodiscard]] Result<World3> ParseWorld3(const std::string& text, const std::string& source);

// A world of either kind.
[[nodiscard]] Result<Surroundings> ParseSurroundings(const std::string& text, const std::string& source);

}  // namespace cairn::sim
