// Whether fitting robots that said where they start to each other makes the map of their site better: how far it moves
// what they have drawn, and how well what each has seen agrees with what the others have drawn, before and after. A
// robot's own part of the map says nothing about that: it agrees with its own scans wherever it lies. Stateless,
// deterministic.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/robots/robot_event.h"
#include "server/slam/site/site_smoothing.h"

namespace cairn::server {

struct Alignment {
  double moved_m = 0.0;    // The farthest that a keyframe moves.
  double cell_m = 0.0;     // The side of the map's cells.
  double before_m2 = 0.0;  // Disagreement of scans with the maps of others (slam/grid/disagreement.h).
  double after_m2 = 0.0;
  double agreement_before = 0.0;  // SmoothedSession, mean over the sessions.
  double agreement = 0.0;

  // It moves something by more than a cell, scans are clearly less off the maps of others (their mean square by a tenth
  // or more), and the agreement of the sessions is not worse.
  [[nodiscard]] bool IsBetter() const;
};

// Of the sessions that are joined with others and whose starts are known. `go_on` is asked before each scan. Nothing:
// it said no.
[[nodiscard]] std::optional<Alignment> AlignmentOf(const std::vector<SessionMaterial>& material,
                                                   const std::vector<slam::SmoothedSession>& joint,
                                                   const std::function<bool()>& go_on);

// When the next job of a site is to align. To align takes long, and no job looks for the place of another robot
// meanwhile. So while a robot waits for being joined, a job aligns only when the robots whose places are known have
// twice as many keyframes as when they were aligned last, or when the last one of them was joined, or one of them a
// thousand more (some 200 m of way): otherwise relations between the robots of today would be looked for after days
// only, where a robot that is never joined waits in a site with a long past. Not thread-safe.
class AlignmentPace {
 public:
  // Asked by every job that may align; where it says so, the job does.
  [[nodiscard]] bool IsDue(const std::string& site, const std::vector<SessionMaterial>& material);
  // Forgets all other sites.
  void KeepOnly(const std::function<bool(const std::string&)>& exists);

 private:
  // The sessions whose places were known then, and the keyframes that each had made.
  using Known = std::map<SessionId, std::uint64_t>;
  std::map<std::string, Known> sites_;
};

}  // namespace cairn::server
