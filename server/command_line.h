// cairnd's command line: what to do, and with which options. Precedence, lowest first: defaults, --config, --set,
// --domain, --log-level; CAIRN_DOMAIN stands between the file and --set (common/wire/wire_arguments.h).
#pragma once

#include <optional>

#include "server/cairnd_options.h"

namespace cairn::server {

enum class Task { kServe, kPrintConfig, kCheckConfig };

struct CommandLine {
  Task task = Task::kServe;
  CairndOptions options;
};

// Nothing where the program is to end at once with `exit_code`: 0 after --help and --version, 2 for a wrong command
// line or configuration, which the next start would meet again. What was wrong is on standard error.
[[nodiscard]] std::optional<CommandLine> ParseCommandLine(int argc, char** argv, int& exit_code);

}  // namespace cairn::server
