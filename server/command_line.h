// The command line of cairnd: the task and the options. Precedence, lowest first: defaults, --config, the
// environment variable CAIRN_DOMAIN, --set, --domain, --log-level, --log-format (see common/wire/wire_arguments.h).
#pragma once

#include <filesystem>
#include <optional>

#include "common/options/option_visitor.h"
#include "common/status.h"
#include "common/wire/bus.h"
#include "server/options.h"
#include "server/ros2/ros2_options.h"

namespace cairn::server {

// All options of cairnd, those of the server, of the wire and of the door for ROS 2, as one tree.
struct CairndOptions {
  ServerOptions server;
  wire::WireOptions wire;
  Ros2Options ros2;
};
void Visit(OptionVisitor& visitor, CairndOptions& options);
// Checks what does not depend on the machine: fields that contradict each other, names of sites, and
// addresses. It reads no file.
[[nodiscard]] Result<void> Validate(const CairndOptions& options);

enum class Task { kServe, kPrintConfig, kCheckConfig };

struct CommandLine {
  Task task = Task::kServe;
  CairndOptions options;
  std::filesystem::path state;  // server/state_directory.h; kInMemory: nothing outlives the process.
};

// Returns nothing if the program is to end at once with `exit_code`: 0 after --help and --version, 2 for a
// wrong command line or configuration (a restart would fail in the same way). The error is written to
// standard error.
[[nodiscard]] std::optional<CommandLine> ParseCommandLine(int argc, char** argv, int& exit_code);

}  // namespace cairn::server
