// What a person has said about a site's map. It stays as it is, whatever robots see and however often the map is
// smoothed, until a person removes it. Plain values and stateless functions; thread-safe.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/stamp.h"
#include "common/status.h"

namespace cairn {

enum class MapEditKind : std::uint8_t {
  kFree = 0,  // Nothing stands here.
  kUnknown,   // What robots have drawn here does not count.
  kOccupied,  // Something stands here that lidars may not see, such as a glass wall.
  // Robots must not drive here. The tiles of the map stay as they are, because robots are localised by them.
  kKeepOut,
  // The origin of the building's frame and a point on its x axis (building_frame.h); the last one counts. The tiles of
  // the map stay as they are.
  kOrigin,
};
inline constexpr int kMapEditKindCount = 5;
// "free", "unknown", "occupied", "keep_out" and "origin".
[[nodiscard]] std::string_view MapEditKindName(MapEditKind kind);

inline constexpr std::size_t kMostEditPoints = 64;
inline constexpr std::size_t kMostEditNoteBytes = 256;
inline constexpr double kFarthestInEdit_m = 100.0;

struct MapEdit {
  std::uint64_t id = 0;  // Given by the server. No other edit of the site has it, also none that was removed.
  MapEditKind kind = MapEditKind::kFree;
  // In the map frame. With a width they are the points of a line, otherwise the corners of an area in their order.
  std::vector<Eigen::Vector2d> points_map;
  double width_m = 0.0;
  std::string note;  // For people.
  Stamp made = 0;    // By the server's clock.

  bool operator==(const MapEdit&) const = default;
};

// INVALID_ARGUMENT, with the reason: too few or too many points, or some that are not finite or farther than 10 km from
// the origin, or than kFarthestInEdit_m from the first of them; an area without a surface; a line of less than 1 cm or
// more than 10 m; an origin of other than two points, or with an axis of less than 1 cm; a note of more than
// kMostEditNoteBytes, or one that is not UTF-8 or has control characters.
[[nodiscard]] Result<void> ValidateMapEdit(const MapEdit& edit);

// The same edit where the map's coordinates are changed.
[[nodiscard]] MapEdit Moved(const MapEdit& edit, const Pose2& T_into_from);

// Neighbouring cells of a row; the last one is part of it. Cell (0,0) has its lower-left corner at the map's origin.
struct CellRun {
  int y = 0;
  int x_first = 0, x_last = 0;

  bool operator==(const CellRun&) const = default;
};
// The cells whose centres are in the edit. A line is at least as wide as a cell's diagonal, so that it has no gaps. A
// cell may be in several runs. REQUIRES: ValidateMapEdit(edit); 0.001 <= resolution_m.
[[nodiscard]] std::vector<CellRun> CellsOf(const MapEdit& edit, double resolution_m);

}  // namespace cairn
