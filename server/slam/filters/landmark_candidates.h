// Finds what may become a landmark among a scan's features: a real corner or a line ended on both sides is a candidate;
// a candidate seen often enough, with nothing like it nearby, is a stable sighting. Which landmark it shows is not
// decided here: every particle has its own answer.
// Candidates live in the front-end's frame `track`, where a feature stays put from one keyframe to the next. Bounded by
// what was in sight over the last metres. Not thread-safe.
// Source: thesis A 4.4, Tables 3.33, 3.35. Corrected: there "not found" is decided after all entries were compared, not
// at the first that differs, and the count raised is that of the memory entry, not of the feature. Ours forgets a
// candidate after travelling, not at the first keyframe that misses it.
#pragma once

#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/filters/landmark_options.h"
#include "server/slam/filters/landmark_sighting.h"

namespace cairn::slam {

class LandmarkCandidates {
 public:
  explicit LandmarkCandidates(const LandmarkOptions& options) : options_(options) {}

  // The stable features of one keyframe that are due: a candidate in view is shown again after `min_travel_m`.
  [[nodiscard]] std::vector<LandmarkSighting> Observe(const ScanFeatures& features, const Pose2& T_track_robot,
                                                      double travelled_m);

 private:
  struct Feature {
    LandmarkSignature signature;
    Eigen::Vector2d p_robot;
    double slope = 0.0;
  };
  struct Candidate {
    LandmarkSignature signature;
    Eigen::Vector2d p_track;
    double slope_track = 0.0;
    int sightings = 0;
    double last_seen_m = 0.0;
    std::ptrdiff_t slot = -1;  // None before it is stable.
    double last_shown_m = 0.0;
  };

  [[nodiscard]] std::vector<Feature> UsableFeatures(const ScanFeatures& features) const;
  Candidate& CandidateOf(const Feature& feature, const Pose2& T_track_robot, double travelled_m);

  LandmarkOptions options_;
  std::vector<Candidate> candidates_;
  std::ptrdiff_t slots_ = 0;
};

}  // namespace cairn::slam
