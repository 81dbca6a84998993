// The result of smoothing one robot's data: its whole path, the grid drawn anew along that path, and how well
// the scans agree with this grid and with the grid along the online path. If no place was seen again there is
// nothing to optimise. Then two paths are compared, the best particle's (one sample of many) and the online
// path (their mean), and the result is the online path, unless the scans clearly agree better with the other one: each
// scan is compared with a map in which it was not drawn. Where few places were seen again, the fitted path is not taken
// if the scans clearly agree better with the online path (one that was fitted elsewhere, MapAlong, is taken as it is).
// With `pose_graph.enabled` off it is always the best particle's path (thesis A 5.4). Stateless, thread-safe,
// deterministic. May take seconds on long paths.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "server/slam/grid/disagreement.h"
#include "server/slam/smoothing/drawn_map.h"
#include "server/slam/trail/keyframe.h"

namespace cairn::slam {

// The path that a smoothing job returns: the best particle's path (full SLAM), which is one sample, optimised
// so that all steps, revisits and loops fit best. If there are no such relations, or `pose_graph.enabled` is
// off, it is the best particle's path without change.
// One pose T_map_robot per keyframe. Stateless, thread-safe, deterministic. May take seconds on long paths.
// Source: thesis A 5.4 (full SLAM); Lu and Milios 1997.
// `go_on`, if given, is called after each iteration; if it returns false there is no result.
[[nodiscard]] std::optional<std::vector<Pose2>> SmoothedPath(const MapperSnapshot& snapshot,
                                                             const std::function<bool()>& go_on);
[[nodiscard]] std::vector<Pose2> SmoothedPath(const MapperSnapshot& snapshot);

struct SmoothedMap {
  std::vector<Pose2> path;  // T_map_robot, one per keyframe.
  OccupancyGrid grid;       // Drawn along `path`, or as near to it as drawn_map.h says where drawings were kept.
  Disagreement before;      // The scans along the online path against the grid drawn along it.
  Disagreement after;       // The scans along `path` against `grid`.
};

// The map along a path that was fitted elsewhere, together with those of other robots (server/slam/site). `next` and
// `drawn`: as below.
[[nodiscard]] std::optional<SmoothedMap> MapAlong(const MapperSnapshot& snapshot, std::vector<Pose2> path,
                                                  const GridOptions& options, const std::function<bool()>& next,
                                                  DrawnMaps* drawn = nullptr);

// How often SmoothMap calls `next` at most; MapAlong, if the path was `fitted_elsewhere`.
[[nodiscard]] std::size_t SmoothingSteps(const MapperSnapshot& snapshot, bool fitted_elsewhere = false);

// `next` is called before each step, and `go_on` between the iterations of the optimisation. If either
// returns false, the work ends and there is no result. `drawn`: what was drawn the last time, which makes it cheap to
// draw what has not changed; where there is a result, what was drawn now replaces it. Null: all is drawn anew.
[[nodiscard]] std::optional<SmoothedMap> SmoothMap(const MapperSnapshot& snapshot, const GridOptions& options,
                                                   const std::function<bool()>& next,
                                                   const std::function<bool()>& go_on = {}, DrawnMaps* drawn = nullptr);

}  // namespace cairn::slam
