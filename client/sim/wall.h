// A wall with a thickness and doorways: the solid strip around a centre line, cut where its gaps are.
// The strip reaches half a thickness beyond both ends, so walls that share an end close the corner.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "client/sim/world.h"

namespace cairn::sim {

struct WallGap {
  double from_m = 0.0;  // Along the centre line, from its first end.
  double to_m = 0.0;
};

struct Wall {
  Eigen::Vector2d a_map;
  Eigen::Vector2d b_map;
  double thickness_m = 0.12;
  std::vector<WallGap> gaps;  // In order, apart, within the wall.
};

// Adds the outlines of the wall's solid pieces. The ends must differ.
void AppendWall(const Wall& wall, std::vector<Segment>* segments);

}  // namespace cairn::sim
