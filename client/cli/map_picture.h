// Draws a map with trajectories over it as a picture for people: crisp walls, one colour per robot, scale bar, legend.
// Not a map format: nothing reads it back (map export writes those). Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/map/occupancy_image.h"
#include "common/sensor/trajectory.h"
#include "common/status.h"

namespace cairn::client {

struct PicturePath {
  std::string label;
  Trajectory trajectory;
  bool reference = false;  // True for a ground truth: it is drawn thin and grey, below the other paths.
};

struct PictureOptions {
  int width_px = 1800;    // 200..8000. Of the map; the height follows from it.
  double margin_m = 0.6;  // Unknown space kept around what is known.
  std::string title;      // Above the map; empty: none.
};

// The PNG's bytes. Fails where neither the map nor a path has anything to show.
[[nodiscard]] Result<std::vector<std::uint8_t>> DrawMapPicture(const OccupancyImage& map,
                                                               const std::vector<PicturePath>& paths,
                                                               const PictureOptions& options);

// A round length (1, 2 or 5 times a power of ten) near `wanted_m`, not above it.
[[nodiscard]] double RoundLength(double wanted_m);

}  // namespace cairn::client
