#include "server/slam/site/believed_relations.h"

#include <map>

namespace cairn::slam {

std::vector<SessionRelation> BelievedBetween(const SiteGraph& graph, std::size_t a, std::size_t b,
                                             const RelationBook& book) {
  std::vector<SessionRelation> believed;
  book.ForEachBelieved({graph.map(a).session(), graph.map(b).session()}, [&](const Measurement& one) {
    const auto known = graph.map(a).IndexOf(one.known), seen = graph.map(b).IndexOf(one.seen);
    if (known && seen) believed.push_back({{a, *known}, {b, *seen}, one.T_known_seen, one.covariance});
  });
  return believed;
}

void NoteBelieved(const SiteGraph& graph, std::size_t a, std::size_t b, RelationBook& book) {
  std::map<std::uint64_t, const SessionRelation*> by_seen;
  for (const SessionRelation& one : graph.relations())
    if (one.from.session == a && one.to.session == b) by_seen[graph.map(b).id(one.to.keyframe).number] = &one;
  book.SetBelieved({graph.map(a).session(), graph.map(b).session()}, [&](const Measurement& one) {
    const auto relation = by_seen.find(one.seen.number);
    return relation != by_seen.end() && graph.map(a).id(relation->second->from.keyframe) == one.known &&
           relation->second->T_from_to == one.T_known_seen;
  });
}

}  // namespace cairn::slam
