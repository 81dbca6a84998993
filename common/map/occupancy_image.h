// A whole map as one image with its place, and Nav2's map.yaml + PGM/PNG pair for it (trinary: 254 free, 205 unknown,
// 0 occupied; image row 0 = highest y; origin with full precision).
// Source: nav2_map_server map_io; ROS 1 map_server (free_thresh 0.196).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/map/tile.h"
#include "common/status.h"

namespace cairn {

struct OccupancyImage {
  double resolution_m = 0.05;
  Pose2 T_map_origin;  // Lower-left corner of cell (0,0).
  int width = 0;       // Cells.
  int height = 0;
  std::vector<std::uint8_t> cells;  // Row-major from the lowest y; 0..100, 255 unknown.
};

// Assembles the level-0 tiles' bounding box. Empty input gives a 0 x 0 image.
[[nodiscard]] Result<OccupancyImage> AssembleTiles(const std::vector<Tile>& tiles, double level0_resolution_m);

enum class MapImageMode { kTrinary, kScale, kRaw };

struct MapSaveOptions {
  MapImageMode mode = MapImageMode::kTrinary;
  double occupied_thresh = 0.65;  // Cells from here on are occupied,
  double free_thresh = 0.25;      // up to here free. (Trinary files state at most 0.196: see YamlText.)
};

// Writes `yaml_path` and the image beside it (same stem; `.png`, or `.pgm` where `image_extension` says so), each
// atomically, image first.
[[nodiscard]] Result<void> SaveMapYaml(const OccupancyImage& image, const std::filesystem::path& yaml_path,
                                       const std::string& image_extension, const MapSaveOptions& options);
// The same two files as values: the text of the yaml, which names the image, and the image's bytes.
[[nodiscard]] std::string MapYamlText(const OccupancyImage& image, const std::string& image_name,
                                      const MapSaveOptions& options);
[[nodiscard]] Result<std::vector<std::uint8_t>> EncodeMapImage(const OccupancyImage& image,
                                                               const std::string& image_extension,
                                                               const MapSaveOptions& options);
// Reads trinary, scale and raw maps as nav2_map_server does; `negate`, both thresholds and yaw honoured.
[[nodiscard]] Result<OccupancyImage> LoadMapYaml(const std::filesystem::path& yaml_path);

}  // namespace cairn
