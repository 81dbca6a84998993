// Recognises places seen before: picks the old keyframe nearest to where the robot believes it is, and aligns the scan
// with the surfaces seen around that keyframe. Looks only near the given guesses: not a global search.
// What it measures, the robot relative to the keyframe, does not depend on any particle. Not thread-safe (scratch).
// Source: loop detection by scan alignment as in Gutmann and Konolige 1999 (local registration, global correlation).
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/filters/filter.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/matching/region.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

struct RevisitOptions {
  bool enabled = true;
  double min_travel_m = 12.0;   // Between the two sightings of a place; less: it is still the same visit.
  double max_way_m = 60.0;      // Along what is known, between here and there; beyond, LoopSearch has to say so first.
  double max_distance_m = 3.0;  // Between the robot and the old keyframe, as believed.
  double max_turn_rad = 1.2;    // ... and their headings; a half-circle scanner sees nothing common beyond.
  std::int64_t neighbours = 8;  // Keyframes on either side whose surfaces are added.
  std::int64_t guesses = 6;     // Particles whose beliefs are tried where the best one's fails.
  double guess_sigma_m = 0.5;   // How far the match may pull from a guess.
  double guess_sigma_rad = 0.15;
  double min_score = 0.6;  // Share of the scan that must be explained.
  double sigma_m = 0.1;    // Added to the match's own uncertainty: neighbouring matches err alike.
  double sigma_rad = 0.02;
};
void Visit(OptionVisitor& visitor, RevisitOptions& options);

class RevisitSearch {
 public:
  RevisitSearch(const RevisitOptions& options, const PointToLineOptions& align);

  // `distances_m[k]`: along what is known, from the last keyframe to keyframe k.
  [[nodiscard]] std::optional<RevisitObservation> Find(std::span<const SurfacePoint> points_robot,
                                                       const std::vector<KeyframeShape>& keyframes,
                                                       std::span<const double> distances_m, double travelled_m,
                                                       const Filter& filter, const ParallelFor& parallel_for);

 private:
  MatchResult AlignFromOthers(const Filter& filter, const std::function<MatchResult(const Hypothesis&)>& align,
                              const ParallelFor& parallel_for) const;
  // The surfaces around keyframe `centre`, in its robot frame.
  void BuildReference(const std::vector<KeyframeShape>& keyframes, std::size_t centre);

  RevisitOptions options_;
  PointToLineOptions align_;
  PointIndex reference_;  // Scratch.
};

}  // namespace cairn::slam
