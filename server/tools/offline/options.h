// The command line of cairn-offline.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/log_reader.h"
#include "server/slam/mapper_options.h"

namespace cairn::server {

struct OfflineOptions {
  std::vector<std::filesystem::path> logs;  // Each of one robot. At least one.
  // One per log, or none: then these files are not written.
  std::vector<std::filesystem::path> trajectories;
  std::vector<std::filesystem::path> known_trajectories;
  std::vector<std::filesystem::path> smoothed_trajectories;
  // An empty path means "do not write this file", here and below. All but the smoothed map are those of a single log.
  std::filesystem::path map;
  std::filesystem::path map_lines;
  std::filesystem::path used_log;
  // The map.yaml in which the robot of a single log is only localised; empty: it maps.
  std::filesystem::path known_map;
  bool smooth = false;
  std::filesystem::path smoothed_map;
  // One per log: where its robot stands at first. Nothing: unknown, and found by what the others have seen.
  std::vector<std::optional<Pose2>> starts;
  std::int64_t threads = 0;  // 0: one per core.
  bool json = false;
  LogReaderOptions reader = {.all_lidars = true};
  slam::MapperOptions slam;
};

// Returns nothing if the program is to end at once with `exit_code`: 0 after --help or --version, 2 for a
// wrong command line or configuration. The error is written to standard error.
[[nodiscard]] std::optional<OfflineOptions> ParseOfflineOptions(int argc, char** argv, int& exit_code);

}  // namespace cairn::server
