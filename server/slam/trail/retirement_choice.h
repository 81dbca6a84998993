// Which keyframes of a trail show nothing new. Of the visits of a place the first is kept, because later ones were
// matched with it, and the last ones, because they show the place as it is now. The keyframes of the visits between are
// retired where matches bind them to others: each is represented by a kept keyframe near it, which takes over its
// relations (Trail::Retire). So memory and time follow the area and not the way driven. Stateless, deterministic.
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
