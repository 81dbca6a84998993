// Whether a match constrains the robot in every direction of the plane, or leaves one direction free (a
// corridor, a single wall). Stateless, thread-safe.
#pragma once

#include "server/slam/matching/match_prior.h"
#include "server/slam/matching/match_result.h"

namespace cairn::slam {

// A value of `ratio` for JudgeDegeneracy that suits all matchers of points and lines: a room is far above it,
// a corridor far below.
inline constexpr double kCorridorRatio = 0.02;

// Sets `degenerate` and `degenerate_direction`. H is the information on (x, y, theta). The match is
// degenerate if, with the heading left free, the smallest eigenvalue of the information on the translation is
// below `ratio` times the largest. The direction is the eigenvector of the smallest.
void JudgeDegeneracy(const Eigen::Matrix3d& H, double ratio, MatchResult& result);

// Combines two translations: across `along` the result is `measured`, along it `prior`. Both are in one
// frame; `along` is a unit vector.
[[nodiscard]] Eigen::Vector2d TakeAlongFromPrior(const Eigen::Vector2d& measured, const Eigen::Vector2d& prior,
                                                 const Eigen::Vector2d& along);

// The same for a whole result, if it is degenerate: position and uncertainty along the degenerate direction
// are replaced by those of the prior. Apparent evidence along a corridor is only the end of the view, which
// moves with the robot.
void TakeAlongFromPrior(const MatchPrior& prior, MatchResult& result);

}  // namespace cairn::slam
