// The map of one robot, drawn along a path, with what it was drawn from. It is kept from one smoothing job to the next,
// so that a map is drawn at the cost of what has changed: keyframes that are new, that are gone, or whose poses have
// moved by so much that the end of one of their rays lies more than a fifth of a cell from where it was drawn. The
// distance is always that from the pose with which the keyframe was drawn, so that small moves add up.
// The order in which scans are drawn matters, because cells are clamped. So chunks in which anything has changed (but
// for keyframes at the end of the path) are drawn again as a whole, by all scans that reach them, in order. The result
// is, byte for byte, what is drawn anew at DrawnKeyframe::T_map_robot. So are the comparisons of scans with the map.
// Plain values; copies share the chunks. Deterministic.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/grid/disagreement.h"
#include "server/slam/grid/occupancy_grid.h"
#include "server/slam/trail/keyframe.h"

namespace cairn::slam {

struct DrawnKeyframe {
  std::uint64_t number = 0;
  Stamp stamp = 0;
  Pose2 T_map_robot;                    // With which it was drawn.
  double reach_m = 0.0;                 // From the robot to the farthest end of a ray, or a little more.
  std::vector<ChunkKey> drawn_in;       // Chunks.
  std::vector<ChunkKey> compared_with;  // Blocks (disagreement.h), in order.
  Disagreement disagreement;            // With the map.
};

struct DrawnMap {
  GridOptions options;
  OccupancyGrid::Chunks chunks;
  std::vector<DrawnKeyframe> keyframes;  // Those that are localized, in order.
  std::size_t drawn_anew = 0;            // Keyframes that are not as they were in an earlier drawing.

  // Of all scans.
  [[nodiscard]] Disagreement Sum() const;
  // Memory. Chunks count, although others may share them.
  [[nodiscard]] std::size_t Bytes() const;
};

// What a smoothing job draws of one robot. Null: nothing yet.
struct DrawnMaps {
  std::shared_ptr<const DrawnMap> online;  // Along the online path.
  std::shared_ptr<const DrawnMap> smoothed;

  [[nodiscard]] std::size_t Bytes() const;
};

// Draws the keyframes along `path`, and compares each with the map. `earlier`: drawings of the same robot, of which the
// one is continued that has most in common with `path`; null ones are allowed, and without any all is drawn anew.
// `next` is called twice for each keyframe; if it returns false, there is no result.
[[nodiscard]] std::shared_ptr<const DrawnMap> DrawMap(const MapperSnapshot& snapshot, const std::vector<Pose2>& path,
                                                      const GridOptions& options,
                                                      std::span<const std::shared_ptr<const DrawnMap>> earlier,
                                                      const std::function<bool()>& next);

}  // namespace cairn::slam
