// Where two sessions that lie together are tied to each other: the doubt of how they lie grows with the way from there.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "server/slam/site/relation_search.h"
#include "server/slam/site/site_graph.h"

namespace cairn::slam {

// The relations between two sessions, some metres apart. Sessions that are related only through others are tied where
// they come nearest, if that is within `reach_m`; else their first keyframes are named. REQUIRES: a < b.
[[nodiscard]] std::vector<Tie> TiesBetween(const SiteGraph& graph, std::size_t a, std::size_t b, double reach_m);

// A path of poses as one that is searched for what lies near.
[[nodiscard]] PosePath AsPosePath(std::span<const Pose2> poses);

// The way from the nearest tie to two keyframes, along both sessions. Infinite without ties.
[[nodiscard]] double WayFromTie(std::span<const Tie> ties, const SessionMap& known, std::size_t known_keyframe,
                                const SessionMap& seen, std::size_t seen_keyframe);

}  // namespace cairn::slam
