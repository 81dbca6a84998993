#include "server/command_line.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <string>
#include <vector>

#include "common/options/config.h"
#include "common/service/names.h"
#include "common/version.h"
#include "common/wire/wire_arguments.h"
#include "server/known_map.h"
#include "server/state_directory.h"

namespace cairn::server {
namespace {

constexpr int kUsage = 2;

bool Complain(const Result<void>& result) {
  if (result) return false;
  std::cerr << "cairnd: " << result.error().message << "\n";
  return true;
}

}  // namespace

void Visit(OptionVisitor& visitor, CairndOptions& options) {
  Visit(visitor, options.server);
  visitor.Section("wire", "The DDS network.", [&] { wire::Visit(visitor, options.wire); });
  visitor.Section("ros2", "Robots that run ROS 2.", [&] { Visit(visitor, options.ros2); });
}

Result<void> Validate(const CairndOptions& options) {
  if (auto valid = wire::Validate(options.wire); !valid) return valid;
  if (auto valid = Validate(options.ros2); !valid) return valid;
  for (const std::string& site : options.server.server.site_names())
    if (auto valid = ValidateName("server.sites", site); !valid) return valid;
  CairndOptions copy = options;
  return CheckRules([&copy](OptionVisitor& visitor) { Visit(visitor, copy); });
}

std::optional<CommandLine> ParseCommandLine(int argc, char** argv, int& exit_code) {
  CLI::App app("Cairn's server: takes laser scans of robots over DDS, answers with poses and the map they share.",
               "cairnd");
  std::string config, log_level, log_format, state;
  wire::WireArguments arguments;
  bool print_config = false, check_config = false;
  app.add_option("--config", config, "Configuration file (YAML); every key has a default");
  app.add_option("--set", arguments.assignments, "Overrides one key, e.g. --set slam.particles=100; may be repeated")
      ->allow_extra_args(false);
  app.add_option("--domain", arguments.domain,
                 "DDS domain (wire.domain); CAIRN_DOMAIN stands below --set and above the file");
  app.add_option("--log-level", log_level, "trace, debug, info, warn, error, critical or off (server.log_level)");
  app.add_option("--log-format", log_format, "text or json (server.log_format)");
  app.add_option("--state", state,
                 "Directory in which the server keeps its state; \"none\" keeps nothing. Default: CAIRN_STATE, the "
                 "StateDirectory of systemd, or cairn/domain-N in XDG_STATE_HOME or ~/.local/state");
  app.add_flag("--print-config", print_config, "Print the whole configuration with comments, and end");
  app.add_flag("--check-config", check_config, "Check the configuration, and end");
  app.set_version_flag("--version", std::string("cairnd ") + kVersion);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    exit_code = app.exit(error) == 0 ? 0 : kUsage;
    return std::nullopt;
  }

  exit_code = kUsage;  // The exit code of every error below.
  CommandLine line;
  const VisitOptions visit = [&line](OptionVisitor& visitor) { Visit(visitor, line.options); };
  if (!config.empty() && Complain(ApplyYamlFile(config, visit))) return std::nullopt;
  if (!log_level.empty()) arguments.assignments.push_back("server.log_level=" + log_level);
  if (!log_format.empty()) arguments.assignments.push_back("server.log_format=" + log_format);
  if (Complain(Apply(arguments, visit)) || Complain(Validate(line.options))) return std::nullopt;
  if (!print_config && Complain(LoadKnownMap(line.options.server.slam))) return std::nullopt;
  if (auto place = StateDirectory(state, line.options.wire.domain)) {
    line.state = std::move(*place);
  } else if (!print_config && !check_config) {
    std::cerr << "cairnd: " << place.error().message << "\n";
    return std::nullopt;
  }
  if (print_config) line.task = Task::kPrintConfig;
  if (check_config) line.task = Task::kCheckConfig;
  return line;
}

}  // namespace cairn::server
