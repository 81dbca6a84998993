// A map of straight walls, as LineMatch knows a building: given in a file, drawn from a floor plan or written by
// `cairn-offline --map-lines`. File: text, `#` begins a comment, the first statement is `cairn-map-lines 1`; then one a
// line, in metres, frame `map`:
//   wall AX AY BX BY   a wall seen from both sides
//   side AX AY BX BY   one side of a wall, seen from the left of the way from A to B
// Plain values, thread-safe.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/status.h"

namespace cairn {

// One side of a wall: the side on the left of the way from a to b can be seen. A wall seen from both sides is two.
struct MapLine {
  Eigen::Vector2d a = Eigen::Vector2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();

  bool operator==(const MapLine&) const = default;
};

// kInvalidArgument names `source`, line and reason. Maps without lines and maps with more than 20,000 are refused.
[[nodiscard]] Result<std::vector<MapLine>> ParseMapLines(std::string_view text, const std::string& source);
// Besides, kNotFound, and kResourceExhausted beyond 4 MiB.
[[nodiscard]] Result<std::vector<MapLine>> ReadMapLines(const std::filesystem::path& path);
// Reads back to the same numbers; kFailedPrecondition if there are none. Written beside the target and renamed
// (atomic).
[[nodiscard]] Result<void> WriteMapLines(const std::vector<MapLine>& lines, const std::filesystem::path& path);

// Lines that come nearer than `reach_m` to a point of the map. Looks at every line.
[[nodiscard]] std::vector<MapLine> LinesNear(const std::vector<MapLine>& map, const Eigen::Vector2d& p_map,
                                             double reach_m);

}  // namespace cairn
