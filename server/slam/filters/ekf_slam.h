// EKF-SLAM: one Gaussian over the robot's pose and every landmark's position, grown by augmentation. Revisits fit its
// theory through old poses kept in the state, one every `anchor_distance_m`; keyframes between them hang on the nearest
// one before, so that a closed loop also moves the path behind. One association for all: nearest and only one within
// the gates. Time and memory grow with the square of landmarks and anchors, which is why both are bounded. Frames:
// T_map_robot; landmarks in `map`. Not thread-safe. No random numbers. Source: thesis C 3.1.2, 4.1 (misprints:
// joint_state.h). Bounds: leaving a landmark out of a Gaussian is exact.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/filters/association.h"
#include "server/slam/filters/back_end_options.h"
#include "server/slam/filters/contradictions.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/joint_state.h"
#include "server/slam/filters/landmark_candidates.h"
#include "server/slam/filters/step_nis.h"

namespace cairn::slam {

struct EkfOptions {
  std::int64_t max_landmarks = 400;  // Beyond: the one seen least often, then least lately, is left out.
  std::int64_t max_anchors = 500;    // Beyond: later keyframes hang on the last one, ever less certainly.
  double anchor_distance_m = 5.0;    // Travelled between old poses kept; smaller: closes loops better, slower.
};
void Visit(OptionVisitor& visitor, EkfOptions& options);

class EkfSlam final : public Filter {
 public:
  EkfSlam(const EkfOptions& options, const BackEndOptions& back_end, const Pose2& T_map_robot_start);

  void Predict(const StepMotion& step) override;
  bool Observe(const RevisitObservation& revisit) override;
  void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) override;
  void Observe(const std::vector<LandmarkSighting>& sightings, double travelled_m);
  void Commit() override;
  // Moves the means; the doubt stays as it was, which is more than there is.
  [[nodiscard]] bool rebases() const override { return true; }
  bool Rebase(std::span<const Pose2> path) override;

  [[nodiscard]] FilterEstimate estimate() const override { return {state_.robot(), state_.covariance<3, 3>(0, 0)}; }
  [[nodiscard]] FilterHealth health() const override;
  [[nodiscard]] std::size_t hypothesis_count() const override { return 1; }
  [[nodiscard]] Hypothesis hypothesis(std::size_t /*index*/) const override { return {state_.robot(), path_}; }
  [[nodiscard]] std::vector<Landmark> landmarks() const override;

  [[nodiscard]] const JointState& state() const { return state_; }

 private:
  struct Entry {
    Eigen::Index at = 0;
    std::size_t slot = 0;
    LandmarkSignature signature;
    double slope_map = 0.0;  // As first seen; not estimated.
    double last_observed_m = 0.0;
    std::uint32_t sightings = 1;
    std::size_t first_keyframe = 0;
  };
  // A keyframe by the anchor it hangs on.
  struct Hung {
    std::size_t anchor = 0;
    Pose2 T_anchor_robot;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // Of T_anchor_robot, in anchor.
  };

  [[nodiscard]] Association Associate(const LandmarkSighting& sighting, double travelled_m) const;
  void AddLandmark(const LandmarkSighting& sighting, double travelled_m);
  void DropLeastUseful();

  EkfOptions options_;
  BackEndOptions back_end_;
  double gate_;
  LandmarkCandidates candidates_;
  JointState state_;
  std::vector<Entry> landmarks_;
  struct Anchor {
    Eigen::Index at = 0;  // In the state.
    std::size_t keyframe = 0;
  };
  std::vector<Anchor> anchors_;
  std::vector<Hung> keyframes_;
  Hung since_anchor_;
  double since_anchor_m_ = 0.0;
  bool moved_path_ = false;  // By an update in this step.
  SharedSequence<Pose2> path_;
  Contradictions contradictions_;
  StepNis nis_;
};

}  // namespace cairn::slam
