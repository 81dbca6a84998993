// Compares the surfaces seen along two stretches of way, which may belong to different paths, and measures how one lies
// relative to the other. It finds nothing if another pose fits nearly as well, if too little of the second stretch is
// explained, or if surfaces lie where beams passed. Frames: the robot frames of the stretches' anchors. Stateless,
// thread-safe, deterministic.
// Source: branch and bound of Hess et al., ICRA 2016; the comparison of free space as in Lu and Milios 1997.
#pragma once

#include <optional>

#include "server/slam/loops/loop_search.h"
#include "server/slam/loops/region.h"
#include "server/slam/loops/region_search.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

// Half width of the search window for a way of zero.
inline constexpr double kLeastDoubtM = 1.5;
// How far around a guess a place is searched for that lies `way_m` away along the known relations.
[[nodiscard]] SearchWindow WindowAround(const Pose2& T_ref_curr_guess, double way_m, const LoopOptions& options);

// T_ref_curr, searched in `window`. The thresholds are `options.max_rival` and `options.max_conflict`.
[[nodiscard]] std::optional<Pose2> MatchStretches(const Trail& trail_ref, const Stretch& ref, const Trail& trail_curr,
                                                  const Stretch& curr, const SearchWindow& window,
                                                  const LoopOptions& options, const PointToLineOptions& align);

}  // namespace cairn::slam
