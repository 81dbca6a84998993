// What a scan that was matched along a corridor does not show. Stateless, thread-safe.
#pragma once

#include <Eigen/Core>
#include <algorithm>

#include "server/slam/matching/match_result.h"

namespace cairn::slam {

// To be added to the covariance of the position of a degenerate match. Along a corridor the match stays where the guess
// was, which is a belief of the path's own: it must not count once more as something that was measured.
[[nodiscard]] inline Eigen::Matrix2d UnseenAlong(const MatchResult& match) {
  constexpr double kOpenSigmaM = 100.0;  // Standard deviation of a position that the scan does not show at all.
  const double variance = 1.0 / std::max(match.open_information, 1.0 / (kOpenSigmaM * kOpenSigmaM));
  return variance * match.degenerate_direction * match.degenerate_direction.transpose();
}

}  // namespace cairn::slam
