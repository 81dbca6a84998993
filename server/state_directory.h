// Finds the directory in which a server keeps its state. Thread rule: call it before threads start, because it reads
// the environment.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "common/status.h"

namespace cairn::server {

// The argument of --state for a server that stores nothing, not even in memory.
inline constexpr std::string_view kNoState = "none";

// The argument of --state; else CAIRN_STATE of the environment, else the StateDirectory of systemd, else
// $XDG_STATE_HOME/cairn/domain-N, else ~/.local/state/cairn/domain-N: servers of two domains do not share their state.
// INVALID_ARGUMENT: there is no home directory.
[[nodiscard]] Result<std::filesystem::path> StateDirectory(const std::string& typed, std::int64_t domain);

}  // namespace cairn::server
