// Deterministic global localisation: the front-end's path, corrected where a stable corner or line is seen
// again after travelling. Corners correct turn and shift, lines with two ends only the turn; several
// corrections from one scan are averaged. A remembered landmark stays as first seen, so the pose becomes no
// better than it was then. Past poses are not corrected; therefore revisits are used only to detect a wrong
// pose (as with `none`).
// Turn and shift are corrected only if the new value is known better than the present one (otherwise the pose
// oscillates, as the thesis warns). A correction larger than drift and noise explain is taken for a mistaken
// feature: it is not applied, and it counts as a contradiction of the present pose.
// Frames: T_map_robot; memory in `map`. Not thread-safe.
// Source: thesis A 3.6.2, Tables 3.34, 3.36. Corrected: Table 3.34 sets found_flag only for a corner that
// does not count yet, so that one which counts would be remembered a second time; its correction is a vector,
// not a distance; "not found" is decided after all entries were compared; the turn is applied first, about
// the robot, and the shift is computed from the corners' positions after the turn.
#pragma once

#include <vector>

#include "server/slam/filters/filter.h"
#include "server/slam/filters/filter_health.h"
#include "server/slam/landmarks/landmark_candidates.h"
#include "server/slam/reckoning/dead_reckoning_filter.h"

namespace cairn::slam {

struct CorrectionOptions {
  double min_travel_m = 15.0;  // Threshold 3 of the thesis: by then the robot may have driven a loop.
};
void Visit(OptionVisitor& visitor, CorrectionOptions& options);

class LandmarkCorrection final : public SinglePathFilter {
 public:
  LandmarkCorrection(const CorrectionOptions& options, const BackEndOptions& back_end, const Pose2& T_map_robot_start);

  void Predict(const StepMotion& step) override;
  bool Observe(const RevisitObservation& revisit) override;  // Returns false: only health() changes.
  void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) override;
  void Observe(const std::vector<LandmarkSighting>& sightings, double travelled_m);

  [[nodiscard]] FilterHealth health() const override { return {1.0, 0.0, 0, contradictions_.diverged()}; }
  [[nodiscard]] std::vector<Landmark> landmarks() const override;
  void Save(StateWriter& archive) const override { archive(*this); }
  void Load(StateReader& archive) override { archive(*this); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.candidates_, self.path_, self.memory_, self.contradictions_);
  }

 private:
  struct Memory {
    std::size_t slot = 0;
    LandmarkSignature signature;
    Eigen::Vector2d p_map = Eigen::Vector2d::Zero();
    double slope_map = 0.0;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // Covariance of the robot's pose at the first sighting.
    double last_used_m = 0.0;
    std::uint32_t sightings = 1;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.slot, self.signature, self.p_map, self.slope_map, self.covariance, self.last_used_m, self.sightings);
    }
  };
  struct Found {
    LandmarkSighting sighting;
    std::size_t memory = 0;
  };
  void Correct(const std::vector<Found>& found);

  CorrectionOptions options_;
  BackEndOptions back_end_;
  LandmarkCandidates candidates_;
  std::vector<Memory> memory_;
  Contradictions contradictions_;
};

}  // namespace cairn::slam
