// Whether a match holds the robot in every direction of the plane, or leaves it free to slide (corridor, one wall).
// Stateless, thread-safe.
#pragma once

#include "server/slam/match_result.h"
#include "server/slam/matching/match_prior.h"

namespace cairn::slam {

// Writes `degenerate` and its direction: the one in which information H of (x, y, theta) holds the translation least,
// with the heading free to follow, where that is less than `ratio` of the most.
void JudgeDegeneracy(const Eigen::Matrix3d& H, double ratio, MatchResult& result);

// What was measured across `along`, what `prior` says along it. Both translations in one frame; `along` a unit vector.
[[nodiscard]] Eigen::Vector2d TakeAlongFromPrior(const Eigen::Vector2d& measured, const Eigen::Vector2d& prior,
                                                 const Eigen::Vector2d& along);

// The same for a whole result, where it is degenerate: place and uncertainty along the direction become the prior's.
// Whatever evidence there seems to be along a corridor is where the view ended, which moves with the robot.
void TakeAlongFromPrior(const MatchPrior& prior, MatchResult& result);

}  // namespace cairn::slam
