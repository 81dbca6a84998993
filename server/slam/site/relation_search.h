// Finds relations between two sessions with the searches that exist for one robot:
//  - Places (PlaceSearch): what was seen along some metres of one session, searched in the whole map of the other. It
//    needs no guess. A place counts only if it has no rival, neither in the map in which it is found nor in that of the
//    session itself: who has seen two equal rooms knows that such a room is no proof.
//  - Revisits (as RevisitSearch): single keyframes aligned with the surroundings of the other session's nearest
//  keyframe.
//    They need a guess good to half a metre and are the exact ones.
//  - Stretches (MatchStretches): where the guess is worse.
// None of them is believed before it is compared with the others (consistent_set.h, site_graph.h).
// What the book holds already (relation_book.h) is not measured again, and what is measured is noted there.
// Frames: see session_map.h. Stateless, deterministic. `go_on` is asked between the searches; if it returns false, what
// was found so far is returned and must not be used.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/site/relation_book.h"
#include "server/slam/site/session_map.h"
#include "server/slam/site/site_options.h"
#include "server/slam/trail/pose_path.h"

namespace cairn::slam {

using GoOn = std::function<bool()>;

// A session by its number, and where it is believed to lie in `site`.
struct PlacedSession {
  std::size_t number = 0;
  const SessionMap& map;
  const PosePath& path;  // T_site_robot, one per keyframe.
};

// Keyframes of a session in the middle of the stretches that are looked for in others, some metres of way apart.
[[nodiscard]] std::vector<std::size_t> PlacesToLookFor(const SessionMap& seen);
// The first keyframe of what is looked for as the place around this one.
[[nodiscard]] std::size_t FirstOfPlace(const SessionMap& seen, std::size_t keyframe);
// The place around a keyframe of `seen` in the map of `known`: a relation from `known` to the last keyframe of the
// place.
[[nodiscard]] std::optional<SessionRelation> RecognisePlace(std::size_t known_number, SessionMap& known,
                                                            std::size_t seen_number, SessionMap& seen,
                                                            std::size_t keyframe, const LoopOptions& options,
                                                            RelationBook& book);

// Two keyframes, one of each session, whose relative pose is taken as known: the doubt of a guess grows with the way
// from there.
struct Tie {
  std::size_t known = 0;
  std::size_t seen = 0;
};

// Revisits and stretches near the believed paths: relations from `known` to `seen`. `ties` must not be empty.
[[nodiscard]] std::vector<SessionRelation> FindRelationsNearby(const PlacedSession& known, const PlacedSession& seen,
                                                               std::span<const Tie> ties, const SiteOptions& options,
                                                               const GoOn& go_on, RelationBook& book);

}  // namespace cairn::slam
