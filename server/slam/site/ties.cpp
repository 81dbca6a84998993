#include "server/slam/site/ties.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

constexpr double kTieEveryM = 3.0;  // Way between two ties.

}  // namespace

PosePath AsPosePath(std::span<const Pose2> poses) {
  PosePath path;
  for (const Pose2& pose : poses) path.Append(pose);
  return path;
}

std::vector<Tie> TiesBetween(const SiteGraph& graph, std::size_t a, std::size_t b, double reach_m) {
  std::vector<Tie> ties;
  const auto near = [&graph](std::size_t session, std::size_t x, std::size_t y) {
    return std::abs(graph.map(session).travelled_m(x) - graph.map(session).travelled_m(y)) < kTieEveryM;
  };
  for (const SessionRelation& one : graph.relations()) {
    if (one.from.session != a || one.to.session != b) continue;
    const Tie tie{one.from.keyframe, one.to.keyframe};
    if (std::ranges::none_of(
            ties, [&](const Tie& other) { return near(a, other.known, tie.known) && near(b, other.seen, tie.seen); }))
      ties.push_back(tie);
  }
  if (!ties.empty()) return ties;
  Tie nearest;
  double least = reach_m;
  const PosePath path_a = AsPosePath(graph.path(a));
  for (std::size_t k = 0; k < graph.path(b).size(); ++k) {
    const Eigen::Vector2d here = graph.path(b)[k].translation();
    ForEachNear(path_a, path_a.size(), here, least, [&](std::size_t i, const Pose2& there) {
      const double away_m = (there.translation() - here).norm();
      if (away_m >= least) return;
      least = away_m;
      nearest = {i, k};
    });
  }
  return {nearest};
}

double WayFromTie(std::span<const Tie> ties, const SessionMap& known, std::size_t known_keyframe,
                  const SessionMap& seen, std::size_t seen_keyframe) {
  double least = std::numeric_limits<double>::infinity();
  for (const Tie& tie : ties)
    least = std::min(least, std::abs(known.travelled_m(tie.known) - known.travelled_m(known_keyframe)) +
                                std::abs(seen.travelled_m(tie.seen) - seen.travelled_m(seen_keyframe)));
  return least;
}

}  // namespace cairn::slam
