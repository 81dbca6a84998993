// Recognises places seen before: selects the old keyframe nearest to the believed pose and aligns the scan
// with the surfaces seen around that keyframe. It searches only near the given guesses and is not a global
// search. The result, the pose of the robot relative to the keyframe, does not depend on any particle, except along a
// corridor: there it stays where the guess was, and its covariance says so. Not
// thread-safe (scratch memory).
// Source: loop detection by scan alignment as in Gutmann and Konolige 1999 (local registration, global
// correlation).
#pragma once

#include <functional>
#include <optional>
#include <span>

#include "server/slam/filters/filter.h"
#include "server/slam/loops/region.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/parallel_for.h"
#include "server/slam/trail/path_index.h"

namespace cairn::slam {

struct RevisitOptions {
  bool enabled = true;
  double max_distance_m = 3.0;
  double max_turn_rad = 1.2;  // A laser with a half circle sees nothing in common beyond this.
  std::int64_t neighbours = 8;
  double sigma_m = 0.03;
};
void Visit(OptionVisitor& visitor, RevisitOptions& options);

class RevisitSearch {
 public:
  RevisitSearch(const RevisitOptions& options, const PointToLineOptions& align);

  // Searches with the scan of the next keyframe, which is not yet part of the trail: its points and the
  // travelled distance. `index` follows the path of the filter's best hypothesis.
  [[nodiscard]] std::optional<RevisitObservation> Find(std::span<const SurfacePoint> points_robot, const Trail& trail,
                                                       double travelled_m, const Filter& filter, const PathIndex& index,
                                                       const ParallelFor& parallel_for);

 private:
  MatchResult AlignFromOthers(const Filter& filter, const std::function<MatchResult(const Hypothesis&)>& align,
                              const ParallelFor& parallel_for) const;
  // Collects the surfaces around keyframe `centre`, in its robot frame.
  void BuildReference(const Trail& trail, std::size_t centre);

  RevisitOptions options_;
  PointToLineOptions align_;
  PointIndex reference_;  // Scratch memory.
};

}  // namespace cairn::slam
