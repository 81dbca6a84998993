#include "server/command_line.h"

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include "common/options/config.h"
#include "common/service/names.h"
#include "common/version.h"
#include "server/setup/known_map.h"

namespace cairn::server {
namespace {

constexpr int kUsage = 2;

bool Complain(const Result<void>& result) {
  if (result) return false;
  std::cerr << "cairnd: " << result.error().message << "\n";
  return true;
}

}  // namespace

std::optional<CommandLine> ParseCommandLine(int argc, char** argv, int& exit_code) {
  CLI::App app("Cairn's server: takes laser scans of robots over DDS, answers with poses and the map they share.",
               "cairnd");
  std::string config, log_level;
  std::vector<std::string> assignments;
  std::optional<std::int64_t> domain;
  bool print_config = false, check_config = false;
  app.add_option("--config", config, "Configuration file (YAML); every key has a default");
  app.add_option("--set", assignments, "Overrides one key, e.g. --set slam.particles=100; may be repeated")
      ->allow_extra_args(false);
  app.add_option("--domain", domain, "DDS domain (wire.domain); CAIRN_DOMAIN stands below --set and above the file");
  app.add_option("--log-level", log_level, "trace, debug, info, warn, error, critical or off (server.log_level)");
  app.add_flag("--print-config", print_config, "Print the whole configuration with comments, and end");
  app.add_flag("--check-config", check_config, "Check the configuration, and end");
  app.set_version_flag("--version", std::string("cairnd ") + kVersion);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    exit_code = app.exit(error) == 0 ? 0 : kUsage;
    return std::nullopt;
  }

  CommandLine line;
  const VisitOptions visit = [&line](OptionVisitor& visitor) { Visit(visitor, line.options); };
  if (!config.empty() && Complain(ApplyYamlFile(config, visit))) {
    exit_code = kUsage;
    return std::nullopt;
  }
  if (const char* of_machine = std::getenv("CAIRN_DOMAIN"); of_machine != nullptr && *of_machine != '\0') {
    if (const auto applied = ApplySet({std::string("wire.domain=") + of_machine}, visit); !applied) {
      std::cerr << "cairnd: CAIRN_DOMAIN: " << applied.error().message << "\n";
      exit_code = kUsage;
      return std::nullopt;
    }
  }
  if (domain) assignments.push_back("wire.domain=" + std::to_string(*domain));
  if (!log_level.empty()) assignments.push_back("server.log_level=" + log_level);
  if (Complain(ApplySet(assignments, visit))) {
    exit_code = kUsage;
    return std::nullopt;
  }
  for (const std::string& site : line.options.server.server.site_names()) {
    if (!Complain(ValidateName("server.sites", site))) continue;
    exit_code = kUsage;
    return std::nullopt;
  }
  if (!print_config && Complain(LoadKnownMap(line.options.server.slam))) {
    exit_code = kUsage;
    return std::nullopt;
  }
  if (print_config) line.task = Task::kPrintConfig;
  if (check_config) line.task = Task::kCheckConfig;
  return line;
}

}  // namespace cairn::server
