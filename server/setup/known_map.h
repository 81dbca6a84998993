// Reads the known map that `slam.filter: line_match` localises in, once, before any mapper is made: the estimator
// itself reads no files.
#pragma once

#include "common/status.h"
#include "server/slam/mapper_options.h"

namespace cairn::server {

// Fills slam.line_match's map from its file where the filter wants one; nothing to do with other filters.
// The error names the key, the file and what is wrong; so it does where the filter's options contradict each other.
[[nodiscard]] Result<void> LoadKnownMap(slam::MapperOptions& options);

}  // namespace cairn::server
