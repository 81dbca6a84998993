// Finds the landmarks among a scan's features. A real corner or a line ended on both sides becomes a candidate; a
// candidate seen often enough, with nothing like it nearby, is stable; a stable one is compared with the landmarks the
// filter already has and is either one of them, seen again after travelling, or a new one.
// Candidates live in the front-end's frame `track`, where a feature stays put from one keyframe to the next; landmarks
// are looked up where the best particle believes them. Bounded by what is in sight. Not thread-safe.
// Source: thesis A 4.4, Tables 3.33, 3.35, 4.3. Corrected: in Tables 3.33/3.35 "not found" is decided after all entries
// were compared, not at the first that differs.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/filters/landmark_observation.h"
#include "server/slam/filters/particle.h"

namespace cairn::slam {

struct LandmarkOptions {
  bool enabled = true;
  std::int64_t min_sightings = 3;        // Keyframes that must show a feature before it can be a landmark.
  double same_distance_m = 0.20;         // Two sightings of one candidate differ by less than this ...
  double same_angle_rad = Radians(8.0);  // ... in slope and corner angle, ...
  double same_length_m = 0.25;           // ... and in a line's length.
  double crowded_m = 0.6;                // Like features nearer to each other are nobody's landmark.
  double match_distance_m = 0.8;         // Between a stable feature and the landmark it may be.
  double match_slope_rad = Radians(12.0);
  double match_nis = 12.0;    // Squared Mahalanobis distance to it, for the best particle.
  double min_travel_m = 5.0;  // Since the landmark's last observation: a feature in view counts once.
  double forget_m = 10.0;     // Travelled since a candidate's last sighting.
};
void Visit(OptionVisitor& visitor, LandmarkOptions& options);

// What does not change with the robot's pose.
struct LandmarkSignature {
  bool corner = false;
  double shape = 0.0;  // Corner: signed angle between its lines, rad. Line: length, m.
};

class LandmarkTracker {
 public:
  LandmarkTracker(const LandmarkOptions& options, const LandmarkNoise& noise);

  // The observations of one keyframe, known ones first; new ones get the ids that follow `landmark_count`.
  [[nodiscard]] std::vector<LandmarkObservation> Observe(const ScanFeatures& features, const Pose2& T_track_robot,
                                                         double travelled_m, const Particle& best);

  [[nodiscard]] const std::vector<LandmarkSignature>& signatures() const { return signatures_; }

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
    std::optional<std::size_t> id;  // Of the landmark it turned out to be.
  };

  [[nodiscard]] std::vector<Feature> UsableFeatures(const ScanFeatures& features) const;
  Candidate& CandidateOf(const Feature& feature, const Pose2& T_track_robot, double travelled_m);
  [[nodiscard]] bool Alike(const LandmarkSignature& a, const LandmarkSignature& b) const;
  // The one known landmark the feature can be; nothing where none is, `ambiguous` where several are.
  [[nodiscard]] std::optional<std::size_t> Recognise(const Feature& feature, const Particle& best,
                                                     bool& ambiguous) const;

  LandmarkOptions options_;
  LandmarkNoise noise_;
  std::vector<Candidate> candidates_;
  std::vector<LandmarkSignature> signatures_;  // By landmark id.
  std::vector<double> last_observed_m_;        // By landmark id.
};

}  // namespace cairn::slam
