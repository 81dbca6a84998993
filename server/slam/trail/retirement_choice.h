// Which keyframes of a trail show nothing new. A place that a robot passes day after day is kept as the first visit has
// seen it, because the map hangs together by it, and as the last visits have, because they show it as it is now. The
// visits between are retired if they are bound to the others by relations: each of their keyframes is represented by
// one that stays at the same place, to which its relations are handed over (Trail::Retire). So memory and time follow
// the area and not the way driven. Stateless, deterministic.
// Source: Johannsson et al. 2013 (a pose graph that grows with the area only).
#pragma once

#include <cstdint>
#include <optional>

#include "common/options/option_visitor.h"
#include "server/slam/trail/pose_path.h"
#include "server/slam/trail/retirement.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {

struct RetireOptions {
  bool enabled = true;
  std::int64_t from_keyframes = 8192;
  std::int64_t recent_keyframes = 1024;
  std::int64_t visits = 3;
  double cell_m = 1.0;
};
void Visit(OptionVisitor& visitor, RetireOptions& options);

// The keyframes to retire among the first `end`, where `path` (T_map_robot, one per keyframe) says that they lie.
// Nothing if there are too few to be worth the work.
[[nodiscard]] std::optional<Retirement> ChooseRetired(const Trail& trail, const PosePath& path, std::size_t end,
                                                      const RetireOptions& options);

}  // namespace cairn::slam
