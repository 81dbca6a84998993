// Makes the cloud of a log and a path, as `cairn cloud export` does. No server: the path is handed in.
#pragma once

#include <optional>
#include <string>

#include "client/sim/cloud_error.h"
#include "common/cloud/cloud_builder.h"
#include "common/cloud/cloud_file.h"
#include "common/sensor/log_reader.h"

namespace cairn::client {

struct CloudExportOptions {
  std::string log;
  std::string output;
  bool text = false;
  std::string truth_world;  // A world in space to measure the cloud against; empty: none.
  CloudOptions cloud;
  LogReaderOptions reader = {.all_lidars = true};
};

struct CloudExportReport {
  std::size_t points = 0;
  std::int64_t scans_used = 0;
  std::int64_t scans_tilted = 0;
  std::int64_t scans_level = 0;  // Left out by --tilted-only.
  std::int64_t scans_invalid = 0;
  std::int64_t scans_without_pose = 0;
  std::optional<sim::CloudError> wall_error;
};

// Writes the file. Fails if no scan of the log has a pose on the path.
[[nodiscard]] Result<CloudExportReport> ExportCloud(const Trajectory& path, const CloudExportOptions& options);

}  // namespace cairn::client
