// Looks for signs that two sessions which lie together have been joined at a wrong place. A robot that had seen only
// one of two equal places could not know that there is another. What both see later shows it, if it is looked for away
// from where the join says that it lies. Only places around which a session has hardly any relations are looked for.
// Stateless, deterministic.
#pragma once

#include <cstddef>
#include <deque>
#include <vector>

#include "server/slam/site/relation_search.h"
#include "server/slam/site/site_graph.h"

namespace cairn::slam {

// Relations from `a` to `b` that agree with each other that these sessions, which lie together, lie otherwise than
// they do. `searches`: at most so many that the book does not know already; of one pair only a few, unless they find
// something. If `go_on` returns false, the result must not be used. REQUIRES: a < b, here and below.
[[nodiscard]] std::vector<SessionRelation> RivalsOf(const SiteGraph& graph, std::deque<SessionMap>& maps, std::size_t a,
                                                    std::size_t b, std::size_t searches, const LoopOptions& options,
                                                    const GoOn& go_on, RelationBook& book);

// How much of what two sessions have seen is explained by relations between them, in squares of 2 m along the path of
// `b`. Passing through a place again does not count.
[[nodiscard]] std::size_t ExplainedSquares(const SiteGraph& graph, std::size_t a, std::size_t b);

// What holds two sessions together: of the ways to divide all sessions in two, so that the one is on one side and the
// other on the other, the one that cuts the fewest squares of relations.
struct WeakestCut {
  std::size_t squares = 0;
  std::vector<bool> moves;  // For each session, whether it is on the side that is to move.
};
// `told`: the sessions that must not be on the side that moves. REQUIRES: not both are.
// Source: minimum cut by augmenting paths of Edmonds and Karp.
[[nodiscard]] WeakestCut WeakestCutBetween(const SiteGraph& graph, std::size_t a, std::size_t b,
                                           const std::vector<bool>& told);

}  // namespace cairn::slam
