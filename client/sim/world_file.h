// Reads the text format of worlds (client/sim/README.md has the grammar): one statement a line, metres, `#` comments,
// a backslash at the end of a line joins the next. A statement that makes no sense is an error that names source and
// line; nothing is guessed.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "client/sim/world.h"
#include "common/status.h"

namespace cairn::sim {

// `source` names the text in errors.
[[nodiscard]] Result<World> ParseWorld(std::string_view text, const std::string& source);
[[nodiscard]] Result<World> ReadWorldFile(const std::filesystem::path& path);

}  // namespace cairn::sim
