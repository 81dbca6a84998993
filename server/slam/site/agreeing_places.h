// Places of two sessions that are recognised in each other and agree: the proof that two sessions have been at the same
// places, where nobody knows where they started. Stateless, deterministic.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "server/slam/site/relation_search.h"

namespace cairn::slam {

// Relations from `a` to `b`: of the places of each that are recognised in the other the largest set that agrees, if
// these are enough, and cover enough way in both sessions; else none. The search ends with the first proof; it looks at
// places far apart first. `soon_again`: it begins with the newest places, and ends where half of the places have shown
// nothing, because it will be made again. If `go_on` returns false, the result must not be used.
[[nodiscard]] std::vector<SessionRelation> AgreeingPlaces(std::size_t a, SessionMap& map_a, std::size_t b,
                                                          SessionMap& map_b, const LoopOptions& options,
                                                          bool soon_again, const GoOn& go_on, RelationBook& book);

// Whether a relation from `a` to `b` contradicts how the two sessions lie.
using IsRival = std::function<bool(const SessionRelation& place)>;

struct SoughtRivals {
  std::vector<std::size_t> of_a, of_b;  // Keyframes around which the places are, in the order of the search.
  IsRival is_rival;
  // So many searches that the book does not know already, until the first rival is found, and altogether.
  std::size_t most_until_first = 0, most = 0;
};

// As AgreeingPlaces, for two sessions that lie together: relations that agree with each other that they lie otherwise.
[[nodiscard]] std::vector<SessionRelation> RivalPlaces(std::size_t a, SessionMap& map_a, std::size_t b,
                                                       SessionMap& map_b, const SoughtRivals& sought,
                                                       const LoopOptions& options, const GoOn& go_on,
                                                       RelationBook& book);

}  // namespace cairn::slam
