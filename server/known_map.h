// Reads the known map in which `slam.filter: line_match` localises the robot. It is read once, before any
// mapper is made, because the estimator itself reads no files.
#pragma once

#include "common/status.h"
#include "server/slam/mapper_options.h"

namespace cairn::server {

// Reads the map of slam.line_match from its file if slam.filter is line_match; does nothing for other
// filters. The error names the key, the file and the cause.
[[nodiscard]] Result<void> LoadKnownMap(slam::MapperOptions& options);

}  // namespace cairn::server
