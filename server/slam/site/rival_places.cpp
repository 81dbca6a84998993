#include "server/slam/site/rival_places.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "server/slam/loops/stretch_match.h"
#include "server/slam/site/agreeing_places.h"
#include "server/slam/site/ties.h"

namespace cairn::slam {
namespace {

constexpr double kAroundM = 7.5;             // As much way to either side as belongs to a place.
constexpr std::ptrdiff_t kFewRelations = 3;  // Wrong ones may be there by chance.
constexpr std::size_t kSearchesUntilFirst = 4;
constexpr double kOtherHeadingRad = 0.5;  // No error of a path.
constexpr double kSquareM = 2.0;

// The way of the relations of a session, in ascending order.
std::vector<double> RelatedAt(const SiteGraph& graph, std::size_t session) {
  std::vector<double> at_m;
  at_m.reserve(graph.relations().size());
  for (const SessionRelation& one : graph.relations())
    for (const SessionKeyframe& end : {one.from, one.to})
      if (end.session == session) at_m.push_back(graph.map(session).travelled_m(end.keyframe));
  std::ranges::sort(at_m);
  return at_m;
}

using Squares = std::vector<std::vector<std::size_t>>;

// The sessions from which `to` can be reached, each with the next one on the way; `to` follows itself. Those that
// cannot reach it have size() as their next one.
std::vector<std::size_t> WaysTo(std::size_t to, const Squares& left) {
  std::vector<std::size_t> next(left.size(), left.size()), reached{to};
  next[to] = to;
  for (std::size_t i = 0; i < reached.size(); ++i)
    for (std::size_t from = 0; from < left.size(); ++from) {
      if (next[from] != left.size() || left[from][reached[i]] == 0) continue;
      next[from] = reached[i];
      reached.push_back(from);
    }
  return next;
}

// The places of a session around which it has hardly any relations with others, the newest first.
std::vector<std::size_t> UnexplainedPlaces(const SiteGraph& graph, std::size_t session) {
  const SessionMap& map = graph.map(session);
  const std::vector<double> at_m = RelatedAt(graph, session);
  std::vector<std::size_t> places = PlacesToLookFor(map);
  std::erase_if(places, [&](std::size_t k) {
    const auto begin = std::ranges::lower_bound(at_m, map.travelled_m(k) - kAroundM);
    const auto end = std::ranges::upper_bound(at_m, map.travelled_m(k) + kAroundM);
    return end - begin >= kFewRelations;
  });
  std::ranges::reverse(places);
  return places;
}

// Of the ways to divide the sessions that have `session` on the one side and all of `fixed` on the other.
WeakestCut WeakestCutAround(const SiteGraph& graph, std::size_t session, const std::vector<bool>& fixed) {
  Squares left(graph.size(), std::vector<std::size_t>(graph.size(), 0));
  for (std::size_t b = 1; b < graph.size(); ++b)
    for (std::size_t a = 0; a < b; ++a)
      if (graph.Together(a, b)) left[a][b] = left[b][a] = ExplainedSquares(graph, a, b);
  WeakestCut cut;
  for (;;) {
    const std::vector<std::size_t> next = WaysTo(session, left);
    std::size_t begin = 0;
    while (begin < graph.size() && (!fixed[begin] || next[begin] == graph.size())) ++begin;
    if (begin == graph.size()) {
      cut.moves.reserve(graph.size());
      for (const std::size_t one : next) cut.moves.push_back(one != graph.size());
      return cut;
    }
    std::size_t flow = left[begin][next[begin]];
    for (std::size_t at = begin; at != session; at = next[at]) flow = std::min(flow, left[at][next[at]]);
    for (std::size_t at = begin; at != session; at = next[at]) {
      left[at][next[at]] -= flow;
      left[next[at]][at] += flow;
    }
    cut.squares += flow;
  }
}

}  // namespace

std::vector<SessionRelation> RivalsOf(const SiteGraph& graph, std::deque<SessionMap>& maps, std::size_t a,
                                      std::size_t b, std::size_t searches, const LoopOptions& options,
                                      const GoOn& go_on, RelationBook& book) {
  const std::vector<Tie> ties = TiesBetween(graph, a, b, options.max_doubt_m);
  const auto is_rival = [&](const SessionRelation& place) {
    const std::size_t i = place.from.keyframe, k = place.to.keyframe;
    const Pose2 off = Between(Between(graph.path(a)[i], graph.path(b)[k]), place.T_from_to);
    const double way_m = WayFromTie(ties, maps[a], i, maps[b], k);
    return off.translation().norm() > WindowAround({}, way_m, options).reach_m ||
           std::abs(off.theta) > kOtherHeadingRad;
  };
  const SoughtRivals sought{.of_a = UnexplainedPlaces(graph, a),
                            .of_b = UnexplainedPlaces(graph, b),
                            .is_rival = is_rival,
                            .most_until_first = std::min(searches, kSearchesUntilFirst),
                            .most = searches};
  return RivalPlaces(a, maps[a], b, maps[b], sought, options, go_on, book);
}

std::size_t ExplainedSquares(const SiteGraph& graph, std::size_t a, std::size_t b) {
  std::set<std::pair<int, int>> squares;
  for (const SessionRelation& one : graph.relations()) {
    if (one.from.session != a || one.to.session != b) continue;
    const Pose2& here = graph.map(b).own_path()[one.to.keyframe];
    squares.emplace(static_cast<int>(std::floor(here.x / kSquareM)), static_cast<int>(std::floor(here.y / kSquareM)));
  }
  return squares.size();
}

WeakestCut WeakestCutBetween(const SiteGraph& graph, std::size_t a, std::size_t b, const std::vector<bool>& told) {
  const auto around = [&](std::size_t session, std::size_t other) {
    std::vector<bool> fixed(graph.size(), false);
    for (std::size_t s = 0; s < graph.size(); ++s) fixed[s] = s == other || (told[s] && graph.Together(s, other));
    return WeakestCutAround(graph, session, fixed);
  };
  if (told[a]) return around(b, a);
  if (told[b]) return around(a, b);
  const WeakestCut of_a = around(a, b), of_b = around(b, a);
  return of_a.squares < of_b.squares ? of_a : of_b;
}

}  // namespace cairn::slam
