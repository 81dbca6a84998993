#include "client/cli/edit_warning.h"

#include <fmt/format.h>

#include <Eigen/Geometry>

namespace cairn::client {

std::string EditWarning(const MapEdit& edit, const MapInfo& map) {
  if (edit.points_map.empty() || map.tile_count == 0) return {};
  Eigen::AlignedBox2d covered;
  for (const Eigen::Vector2d& point : edit.points_map) covered.extend(point);
  const Eigen::AlignedBox2d drawn(Eigen::Vector2d(map.x_min_m, map.y_min_m), Eigen::Vector2d(map.x_max_m, map.y_max_m));
  if (drawn.intersects(covered)) return {};
  return fmt::format(
      "it lies outside of the map, which is from {:.1f},{:.1f} to {:.1f},{:.1f} m: are its points metres of the map's "
      "frame?",
      drawn.min().x(), drawn.min().y(), drawn.max().x(), drawn.max().y());
}

}  // namespace cairn::client
