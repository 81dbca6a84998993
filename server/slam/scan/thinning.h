// Replaces small clouds of close points by their centre of gravity, so that walls near the sensor do not outweigh the
// rest of a scan, and the rest gets faster. Not a smoother: points farther apart than the window stay where they are.
// Any frame; metres. Points that are not finite are left out. Deterministic: the order of the points decides which
// window is placed first. Stateless, thread-safe.
// Source: thesis C 4.4.3 (Figure 4.18: 181 points to 59), after Lu and Milios 1997.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"

namespace cairn::slam {

struct ThinningOptions {
  double window_m = 0.10;  // Radius, and least distance between what is left; larger: fewer points. 0: all are kept.
};
void Visit(OptionVisitor& visitor, ThinningOptions& options);

// No two of the answer are nearer than `window_m`; none is farther from a point of the input than that, unless whole
// clouds were that near to each other.
[[nodiscard]] std::vector<Eigen::Vector2d> ThinByCentreOfGravity(std::span<const Eigen::Vector2d> points,
                                                                 const ThinningOptions& options);

}  // namespace cairn::slam
