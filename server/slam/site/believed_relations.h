// Which relations between two sessions a job has believed, in the book and from it. Stateless.
#pragma once

#include <cstddef>
#include <vector>

#include "server/slam/site/relation_book.h"
#include "server/slam/site/site_graph.h"

namespace cairn::slam {

// Those that the last job believed, as far as their keyframes are still there. REQUIRES: a < b, here and below.
[[nodiscard]] std::vector<SessionRelation> BelievedBetween(const SiteGraph& graph, std::size_t a, std::size_t b,
                                                           const RelationBook& book);
// Those of the graph are believed from now on, and no others.
void NoteBelieved(const SiteGraph& graph, std::size_t a, std::size_t b, RelationBook& book);

}  // namespace cairn::slam
