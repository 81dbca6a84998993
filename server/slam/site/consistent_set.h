// Selects from measurements of which some are wrong a set in which all agree with each other. Two wrong ones seldom
// agree with each other, and hardly ever with a third. Stateless, thread-safe, deterministic. Source: pairwise
// consistent measurement set maximization of Mangelson, Dominic, Eustice, Vasudevan, ICRA 2018; the largest clique is
// found greedily, from every start.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "server/slam/site/session_map.h"

namespace cairn::slam {

// The chi-square value of three degrees of freedom that is exceeded once in a thousand.
inline constexpr double kMaxChiSquare = 16.27;

// The numbers of the members of the largest set found, in their order. `agree` is symmetric. Time grows with the fourth
// power of `count` at worst.
[[nodiscard]] std::vector<std::size_t> LargestConsistentSet(std::size_t count,
                                                            const std::function<bool(std::size_t, std::size_t)>& agree);

// The squared Mahalanobis distance by which the way round through both relations misses its start. The relations must
// be between the same two sessions, in the same direction. The paths between them count with the doubt of a large loop
// (`loop.doubt_per_m`, `loop.doubt_rad_per_m`).
[[nodiscard]] double Disagreement2(const SessionRelation& a, const SessionRelation& b, const SessionMap& from,
                                   const SessionMap& to, const LoopOptions& loop);

}  // namespace cairn::slam
