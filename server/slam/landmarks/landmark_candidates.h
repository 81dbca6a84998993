// Finds features of a scan that may become landmarks. A real corner or a line ended on both sides is a
// candidate; a candidate that was seen often enough, with no similar feature nearby, gives a stable sighting.
// Which landmark the sighting shows is not decided here: each particle decides that for itself.
// Candidates are stored in the front-end's frame `track`, in which a feature keeps its position from one
// keyframe to the next. Their number is bounded by what was in sight over the last metres. Not thread-safe.
// Source: thesis A 4.4, Tables 3.33, 3.35. Corrected: "not found" is decided only after all entries were
// compared, not at the first one that differs, and the counter of the memory entry is raised, not that of the
// feature. Here a candidate is forgotten after a distance travelled, not at the first keyframe in which it is
// missing.
#pragma once

#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/landmarks/landmark_options.h"
#include "server/slam/landmarks/landmark_sighting.h"

namespace cairn::slam {

class LandmarkCandidates {
 public:
  explicit LandmarkCandidates(const LandmarkOptions& options) : options_(options) {}

  // The stable features of one keyframe that are due. A candidate that stays in view is returned again after
  // `min_travel_m`.
  [[nodiscard]] std::vector<LandmarkSighting> Observe(const ScanFeatures& features, const Pose2& T_track_robot,
                                                      double travelled_m);
  // All slots are below this.
  [[nodiscard]] std::size_t slots() const { return static_cast<std::size_t>(slots_); }
  // Slots for which `used` is false will be given again, but for those of the present candidates. One flag per slot.
  void GiveAgain(const std::vector<bool>& used);

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.candidates_, self.slots_, self.free_);
    bool sound = self.slots_ >= 0;
    for (const Candidate& candidate : self.candidates_) sound = sound && candidate.slot < self.slots_;
    for (const std::ptrdiff_t slot : self.free_) sound = sound && 0 <= slot && slot < self.slots_;
    archive.Require(sound, "the candidates for landmarks");
  }

 private:
  struct Feature {
    LandmarkSignature signature;
    Eigen::Vector2d p_robot;
    double slope = 0.0;
  };
  struct Candidate {
    LandmarkSignature signature;
    Eigen::Vector2d p_track = Eigen::Vector2d::Zero();
    double slope_track = 0.0;
    int sightings = 0;
    double last_seen_m = 0.0;
    std::ptrdiff_t slot = -1;  // -1 before the candidate is stable.
    double last_shown_m = 0.0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.signature, self.p_track, self.slope_track, self.sightings, self.last_seen_m, self.slot,
              self.last_shown_m);
    }
  };

  [[nodiscard]] std::vector<Feature> UsableFeatures(const ScanFeatures& features) const;
  [[nodiscard]] std::ptrdiff_t NextSlot();
  Candidate& CandidateOf(const Feature& feature, const Pose2& T_track_robot, double travelled_m);

  LandmarkOptions options_;
  std::vector<Candidate> candidates_;
  std::ptrdiff_t slots_ = 0;
  std::vector<std::ptrdiff_t> free_;  // Slots to give again, the smallest last.
};

}  // namespace cairn::slam
