// The command line of cairn-offline.
#pragma once

#include <filesystem>
#include <optional>

#include "common/geometry/pose2.h"
#include "common/sensor/log_reader.h"
#include "server/slam/mapper_options.h"

namespace cairn::server {

struct OfflineOptions {
  std::filesystem::path log;
  std::filesystem::path trajectory;  // An empty path means "do not write this file", here and below.
  std::filesystem::path map;
  std::filesystem::path map_lines;
  std::filesystem::path used_log;
  bool smooth = false;
  std::filesystem::path smoothed_trajectory;
  std::filesystem::path smoothed_map;
  Pose2 T_map_robot_start;
  std::int64_t threads = 0;  // 0: one per core.
  bool json = false;
  LogReaderOptions reader;
  slam::MapperOptions slam;
};

// Returns nothing if the program is to end at once with `exit_code`: 0 after --help or --version, 2 for a
// wrong command line or configuration. The error is written to standard error.
[[nodiscard]] std::optional<OfflineOptions> ParseOfflineOptions(int argc, char** argv, int& exit_code);

}  // namespace cairn::server
