// Reads known maps from files, before any mapper is made, because the estimator itself reads no files.
#pragma once

#include <filesystem>
#include <memory>

#include "common/status.h"
#include "server/slam/known_grid/known_grid.h"
#include "server/slam/mapper_options.h"

namespace cairn::server {

// The map in which `slam.filter: line_match` localises the robot. Reads the map of slam.line_match from its file if
// slam.filter is line_match; does nothing for other filters. The error names the key, the file and the cause.
[[nodiscard]] Result<void> LoadKnownMap(slam::MapperOptions& options);

// A map of Nav2 (map.yaml), in which a robot can be localised (slam::Mapper::LocaliseIn) as in the map of a site, with
// cells of slam.grid.resolution_m. The error names the file and the cause.
[[nodiscard]] Result<std::shared_ptr<const slam::KnownGrid>> ReadKnownGrid(const std::filesystem::path& yaml,
                                                                           const slam::MapperOptions& options);

}  // namespace cairn::server
