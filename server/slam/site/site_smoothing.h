// One smoothing over all sessions of a site: finds relations between robots and between runs, and fits all paths to
// them at once. Sessions whose start is unknown or wrong get their place from these relations. A session that does not
// join stays as it is, and the result says so. It prefers leaving a session apart to joining it at a wrong place; but
// who has seen only one of two equal places can not know that there is another.
// Frames: `own` is the map frame of a session before; `site` that of the sessions it is joined with (site_graph.h).
// Stateless but for the book, thread-safe, deterministic (one thread). The first time it takes one to three seconds per
// hundred metres of way and per pair of sessions; what the book holds (relation_book.h) is not measured again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/site/relation_book.h"
#include "server/slam/site/relation_search.h"
#include "server/slam/site/site_options.h"
#include "server/slam/trail/keyframe.h"

namespace cairn::slam {

struct SiteSession {
  const MapperSnapshot& snapshot;
  // Whether the place of its first keyframe in the site is known, to half a metre.
  bool start_known = true;
  std::uint64_t id = 0;  // Its number in the book; of no meaning without one.
  // Its session began without a start, or that was refused; later jobs may find that its place is another one.
  bool start_found = false;
};

struct SmoothedSession {
  std::vector<Pose2> path;  // T_site_robot, one per keyframe.
  bool joined = false;      // Related to other sessions, also where its own frame is the common one.
  std::size_t frame = 0;    // The number of the session in whose frame `path` lies; its own if it is not joined.
  // How its first keyframe has moved. The identity for the session whose frame it is.
  Pose2 T_site_own;
  std::size_t relations = 0;  // With other sessions, after wrong ones were withdrawn.
  std::size_t withdrawn = 0;
  // Confidence: the share of surfaces seen by other sessions as well that are where those saw them. 0 without
  // relations.
  double agreement = 0.0;
  // The same between sessions whose starts are known, along the paths as they were drawn online. Only of kRobots.
  double agreement_before = 0.0;
};

enum class SiteSearch : std::uint8_t {
  kAll = 0,  // All sessions are related with each other.
  // Only sessions whose start is not known are looked for, and only where sessions of a known place have been. Where
  // one is joined, other relations are left to the next call: the robot drives on meanwhile.
  kFragments,
  // These, and sessions whose starts are known with each other. Where joined sessions contradict each other, they are
  // also looked for elsewhere (rival_places.h).
  kRobots,
};

// One result per session. `book`: what earlier jobs have measured; what this one does is noted there, also where it is
// cancelled. Null: nothing is kept. REQUIRES: with a book, all ids differ. `go_on` is asked often and gets the share of
// the work that is done, 0..1; if it returns false, there is no result.
[[nodiscard]] std::optional<std::vector<SmoothedSession>> SmoothSessions(std::span<const SiteSession> sessions,
                                                                         const SiteOptions& options,
                                                                         const std::function<bool(double)>& go_on,
                                                                         SiteSearch search = SiteSearch::kAll,
                                                                         RelationBook* book = nullptr);

}  // namespace cairn::slam
