// The server's log: one line per event on standard error, with UTC time and level. Rooms log changes of state
// (sessions, jobs, versions), never a line per scan.
#pragma once

#include <array>
#include <string_view>

namespace cairn::server {

inline constexpr std::array<std::string_view, 7> kLogLevels = {"trace", "debug",    "info", "warn",
                                                               "error", "critical", "off"};
enum class LogLevel { kTrace = 0, kDebug, kInfo, kWarn, kError, kCritical, kOff };

void StartLogging(LogLevel level);

}  // namespace cairn::server
