#include "server/tools/offline/options.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <string>
#include <utility>
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

Result<void> TakeStarts(const std::vector<std::string>& texts, OfflineOptions& options) {
  const std::size_t logs = options.logs.size();
  if (texts.empty()) {
    const bool at_origin = logs == 1 && options.known_map.empty();
    options.starts.assign(logs, at_origin ? std::optional(Pose2{}) : std::nullopt);
    return {};
  }
  if (texts.size() != logs) {
    return Fail(StatusCode::kInvalidArgument,
                "--start is given " + std::to_string(texts.size()) + " times for " + std::to_string(logs) + " logs");
  }
  for (const std::string& text : texts) {
    if (text == "unknown") {
      options.starts.emplace_back(std::nullopt);
      continue;
    }
    const auto start = ParseStart(text);
    if (!start) return Fail(StatusCode::kInvalidArgument, "--start: " + start.error().message);
    options.starts.emplace_back(*start);
  }
  return {};
}

Result<void> CheckCounts(const OfflineOptions& options) {
  const std::size_t logs = options.logs.size();
  for (const auto& [name, files] :
       {std::pair{"--trajectory", &options.trajectories}, std::pair{"--known-trajectory", &options.known_trajectories},
        std::pair{"--smoothed-trajectory", &options.smoothed_trajectories}}) {
    if (!files->empty() && files->size() != logs) {
      return Fail(StatusCode::kInvalidArgument, std::string(name) + " is given " + std::to_string(files->size()) +
                                                    " times for " + std::to_string(logs) + " logs");
    }
  }
  if (logs > 1 && !(options.map.empty() && options.map_lines.empty()))
    return Fail(StatusCode::kInvalidArgument, "--map and --map-lines take a single log; --smoothed-map takes several");
  const bool maps =
      options.smooth || !(options.map.empty() && options.map_lines.empty() && options.known_trajectories.empty());
  if (!options.known_map.empty() && (logs > 1 || maps))
    return Fail(StatusCode::kInvalidArgument,
                "--known-map takes a single log, whose robot maps nothing: no map and no path of it can be written or "
                "smoothed");
  return {};
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
  CLI::App app{
      "Runs the estimator over a robot log without a server: the same trajectory as through cairnd. Several logs are "
      "robots of one site; they are smoothed together."};
  app.set_version_flag("--version", std::string("cairn-offline ") + kVersion);
  app.add_option("LOG", options.logs, "CARMEN or DP-SLAM log, bag of ROS 2, or recording; several: one per robot")
      ->required();
  // With several logs an option takes one file at a time, so that it does not take the next log.
  app.add_option("--trajectory", options.trajectories, "Write the online trajectory (TUM); once per log")
      ->allow_extra_args(false);
  app.add_option("--known-trajectory", options.known_trajectories,
                 "Write the trajectory as the estimator knows it at the end of the log, without smoothing (TUM); once "
                 "per log")
      ->allow_extra_args(false);
  app.add_option("--map", options.map, "Write the online map (map.yaml and an image beside it)");
  app.add_flag("--smooth", options.smooth, "Also smooth the whole path and redraw the map along it");
  app.add_option("--smoothed-trajectory", options.smoothed_trajectories,
                 "Write the smoothed trajectory (TUM); once per log")
      ->allow_extra_args(false);
  app.add_option("--smoothed-map", options.smoothed_map, "Write the map redrawn along the smoothed path");
  app.add_option("--map-lines", options.map_lines,
                 "Write the walls seen, as lines, for slam.line_match.map (along the smoothed path with --smooth)");
  app.add_option("--known-map", options.known_map,
                 "Map nothing: only localise the robot in this map (map.yaml). It is looked for everywhere, or near "
                 "--start. The trajectory has the poses at which it is localized")
      ->type_name("MAP.yaml");
  std::vector<std::string> starts;
  app.add_option("--start", starts,
                 "Where the robot stands at first (m; rad, or 45deg), or unknown; once per log. Without it a single "
                 "robot starts at the origin, and the starts of several are unknown")
      ->type_name("X,Y,THETA|unknown")
      ->allow_extra_args(false);
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
  options.smooth = options.smooth || !options.smoothed_trajectories.empty() || !options.smoothed_map.empty();
  if (Complain(TakeStarts(starts, options), exit_code) || Complain(CheckCounts(options), exit_code))
    return std::nullopt;
  if (!seed.empty()) assignments.push_back("slam.seed=" + seed);

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
