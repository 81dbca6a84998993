// The server's log: one line per event on standard error, with UTC time and level, as text or as one JSON object a line
// (common/log_line.h). Rooms log changes of state (sessions, jobs, versions) and commands, never a line per scan, and
// questions at level debug only. A line carries the fields of its thread's LogContext.
#pragma once

#include <array>
#include <string_view>

#include "common/log_line.h"

namespace cairn::server {

inline constexpr std::array<std::string_view, 7> kLogLevels = {"trace", "debug",    "info", "warn",
                                                               "error", "critical", "off"};
enum class LogLevel { kTrace = 0, kDebug, kInfo, kWarn, kError, kCritical, kOff };

void StartLogging(LogLevel level, LogFormat format);

}  // namespace cairn::server
