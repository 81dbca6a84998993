// Where a server keeps its state. Thread rule: before threads start, because it reads the environment.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "common/status.h"

namespace cairn::server {

// Typed for a server that keeps nothing, not even in memory.
inline constexpr std::string_view kNoState = "none";

// What was typed (--state), else the environment's CAIRN_STATE, else the StateDirectory of systemd, else
// $XDG_STATE_HOME/cairn/domain-N, else ~/.local/state/cairn/domain-N: servers of two domains do not share their state.
// INVALID_ARGUMENT: there is no home directory.
[[nodiscard]] Result<std::filesystem::path> StateDirectory(const std::string& typed, std::int64_t domain);

}  // namespace cairn::server
