// One small picture of the own map of a robot that is not joined with the map of its site yet. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "client/web/tile_picture.h"
#include "common/map/tile.h"
#include "common/status.h"

namespace cairn::web {

inline constexpr int kMostFragmentPixels = 512;  // Of either side.

struct FragmentPicture {
  // What it covers, in metres in the frame of the robot's start.
  double x_min = 0.0, y_min = 0.0, x_max = 0.0, y_max = 0.0;
  std::string png;
};

// The tiles of one level of the robot's own map.
using AskRobotTiles = std::function<Result<std::vector<Tile>>(std::uint32_t level)>;

// Asks for the coarsest level first, which says how large the map is, and then for the finest one at which it has at
// most kMostFragmentPixels a side. What is unknown around it is cut off. The error of `ask`; kNotFound where nothing is
// drawn yet.
[[nodiscard]] Result<FragmentPicture> DrawFragment(const AskRobotTiles& ask, double level0_resolution_m, Theme theme);

}  // namespace cairn::web
