// Reads worlds of rectangles from YAML (client/sim/README.md has the keys). A key or value that makes no sense is an
// error that names source and line; nothing is guessed.
#pragma once

#include <filesystem>
#include <string>

#include "client/sim/world3.h"
#include "common/status.h"

namespace cairn::sim {

// `source` names the text in errors.
[[nodiscard]] Result<World3> ParseWorld3(const std::string& text, const std::string& source);
[[nodiscard]] Result<World3> ReadWorld3File(const std::filesystem::path& path);

}  // namespace cairn::sim
