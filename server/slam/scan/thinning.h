// Replaces groups of close points by their centre of gravity, so that walls near the sensor do not outweigh
// the rest of a scan and later steps get faster. Not a smoother: points that are farther apart than the
// window stay where they are. Any frame; metres. Points that are not finite are left out. Deterministic: the
// order of the points decides which window is placed first. Stateless, thread-safe.
// Source: thesis C 4.4.3 (Figure 4.18: 181 points to 59), after Lu and Milios 1997.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"

namespace cairn::slam {

struct ThinningOptions {
  double window_m = 0.10;
};
void Visit(OptionVisitor& visitor, ThinningOptions& options);

// No two of the returned points are nearer to each other than `window_m`. Each lies within `window_m` of a
// point of the input, except where later passes merged points again.
[[nodiscard]] std::vector<Eigen::Vector2d> ThinByCentreOfGravity(std::span<const Eigen::Vector2d> points,
                                                                 const ThinningOptions& options);

}  // namespace cairn::slam
