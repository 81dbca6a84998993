#include "server/tools/offline/options.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <string>
#include <vector>

#include "common/options/config.h"
#include "common/sensor/log_options.h"
#include "common/service/start_pose.h"
#include "common/version.h"
#include "server/known_map.h"
#include "server/tools/log_run/server_sections.h"

namespace cairn::server {
namespace {

void VisitSlam(OptionVisitor& visitor, OfflineOptions& options) {
  visitor.Section("slam", "The estimator.", [&] { slam::Visit(visitor, options.slam); });
}

// The sections of cairnd.yaml. The same file can be used for both programs; this one reads only `slam`.
void VisitFile(OptionVisitor& visitor, OfflineOptions& options) {
  VisitSlam(visitor, options);
  IgnoreServerSections(visitor);
}

bool Complain(const Result<void>& result, int& exit_code) {
  if (result) return false;
  std::cerr << "cairn-offline: " << result.error().message << '\n';
  exit_code = 2;
  return true;
}

}  // namespace

std::optional<OfflineOptions> ParseOfflineOptions(int argc, char** argv, int& exit_code) {
  OfflineOptions options;
  std::filesystem::path config;
  std::vector<std::string> assignments;
  std::string seed;  // Kept as text, so that a number that is too large is reported as an error.
  CLI::App app{"Runs the estimator over a robot log without a server: the same trajectory as through cairnd."};
  app.set_version_flag("--version", std::string("cairn-offline ") + kVersion);
  app.add_option("LOG", options.log, "CARMEN or DP-SLAM log")->required();
  app.add_option("--trajectory", options.trajectory, "Write the online trajectory (TUM)");
  app.add_option("--map", options.map, "Write the online map (map.yaml and an image beside it)");
  app.add_flag("--smooth", options.smooth, "Also smooth the whole path and redraw the map along it");
  app.add_option("--smoothed-trajectory", options.smoothed_trajectory, "Write the smoothed trajectory (TUM)");
  app.add_option("--smoothed-map", options.smoothed_map, "Write the map redrawn along the smoothed path");
  app.add_option("--map-lines", options.map_lines,
                 "Write the walls seen, as lines, for slam.line_match.map (along the smoothed path with --smooth)");
  const auto take_start = [&options](const std::string& text) {
    const auto start = ParseStart(text);
    if (!start) throw CLI::ValidationError("--start", start.error().message);
    options.T_map_robot_start = *start;
  };
  app.add_option_function<std::string>("--start", take_start, "Where the robot stands at first (m; rad, or 45deg)")
      ->type_name("X,Y,THETA");
  app.add_option("--config", config, "YAML file; its slam section is used (cairnd's file will do)");
  app.add_option("--set", assignments, "key=value, e.g. slam.particles=100; repeatable, wins over --config")
      ->allow_extra_args(false);
  app.add_option("--seed", seed, "Same as --set slam.seed=N");
  app.add_option("--threads", options.threads, "Number of threads; 0: one per core. The output does not depend on it")
      ->check(CLI::Range(0, 256));
  AddLogOptions(app, options.reader);
  app.add_flag("--json", options.json, "One JSON object on standard output");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    exit_code = app.exit(error) == 0 ? 0 : 2;
    return std::nullopt;
  }
  if (!seed.empty()) assignments.push_back("slam.seed=" + seed);
  options.smooth = options.smooth || !options.smoothed_trajectory.empty() || !options.smoothed_map.empty();

  if (!config.empty() &&
      Complain(ApplyYamlFile(config, [&](OptionVisitor& visitor) { VisitFile(visitor, options); }), exit_code))
    return std::nullopt;
  // Unlike in the file, a key of the server is an error on the command line.
  if (Complain(ApplySet(assignments, [&](OptionVisitor& visitor) { VisitSlam(visitor, options); }), exit_code) ||
      Complain(Validate(options.slam), exit_code) || Complain(LoadKnownMap(options.slam), exit_code))
    return std::nullopt;
  return options;
}

}  // namespace cairn::server
