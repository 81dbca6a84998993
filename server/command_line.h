// The command line of cairnd: the task and the options. Precedence, lowest first: defaults, --config, the
// environment variable CAIRN_DOMAIN, --set, --domain, --log-level (see common/wire/wire_arguments.h).
#pragma once

#include <optional>

#include "server/cairnd_options.h"

namespace cairn::server {

enum class Task { kServe, kPrintConfig, kCheckConfig };

struct CommandLine {
  Task task = Task::kServe;
  CairndOptions options;
};

// Returns nothing if the program is to end at once with `exit_code`: 0 after --help and --version, 2 for a
// wrong command line or configuration (a restart would fail in the same way). The error is written to
// standard error.
[[nodiscard]] std::optional<CommandLine> ParseCommandLine(int argc, char** argv, int& exit_code);

}  // namespace cairn::server
