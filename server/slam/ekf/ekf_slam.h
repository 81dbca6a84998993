// EKF-SLAM: one Gaussian over the robot's pose and every landmark's position, which grows by augmentation.
// Revisits are used through anchors, old poses that are kept in the state, one every `anchor_distance_m`. A
// keyframe between two anchors is stored relative to the anchor before it, so that a closed loop also
// corrects the past path. There is one data association: a sighting belongs to the nearest landmark if that
// is the only one within the gate.
// Time and memory grow with the square of the number of landmarks and anchors, therefore both numbers are
// bounded. Leaving a landmark out of a Gaussian is exact.
// Frames: T_map_robot; landmarks in `map`. Not thread-safe. No random numbers.
// Source: thesis C 3.1.2, 4.1 (misprints: joint_state.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/ekf/joint_state.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/filter_health.h"
#include "server/slam/landmarks/association.h"
#include "server/slam/landmarks/innovation.h"
#include "server/slam/landmarks/landmark_candidates.h"

namespace cairn::slam {

struct EkfOptions {
  std::int64_t max_landmarks = 400;
  std::int64_t max_anchors = 500;
  double anchor_distance_m = 5.0;
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
  [[nodiscard]] bool rebases() const override { return true; }
  // Moves the means only; what the loop tells reaches the covariance by LearnLoop.
  void Rebase(std::span<const Pose2> path) override;
  void LearnLoop(const RevisitObservation& loop) override;
  void MoveTo(std::span<const Pose2> path) override;

  [[nodiscard]] FilterEstimate estimate() const override { return {state_.robot(), state_.covariance<3, 3>(0, 0)}; }
  [[nodiscard]] FilterHealth health() const override;
  [[nodiscard]] std::size_t hypothesis_count() const override { return 1; }
  [[nodiscard]] Hypothesis hypothesis(std::size_t /*index*/) const override { return {state_.robot(), path_}; }
  [[nodiscard]] std::vector<Landmark> landmarks() const override;

  [[nodiscard]] const JointState& state() const { return state_; }

  void Save(StateWriter& archive) const override { archive(*this); }
  void Load(StateReader& archive) override { archive(*this); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.candidates_, self.state_, self.landmarks_, self.anchors_, self.keyframes_, self.since_anchor_,
            self.since_anchor_m_, self.moved_path_, self.path_, self.contradictions_, self.nis_);
    if constexpr (Archive::kReads)
      archive.RequireThat([&] { return self.IsConsistent(archive.keyframes()); }, "the landmarks and anchors");
  }

 private:
  struct Entry {
    Eigen::Index at = 0;
    std::size_t slot = 0;
    LandmarkSignature signature;
    double slope_map = 0.0;  // Slope at the first sighting; not estimated.
    double last_observed_m = 0.0;
    std::uint32_t sightings = 1;
    std::size_t first_keyframe = 0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.at, self.slot, self.signature, self.slope_map, self.last_observed_m, self.sightings,
              self.first_keyframe);
    }
  };
  // A keyframe as a pose relative to its anchor.
  struct Hung {
    std::size_t anchor = 0;
    Pose2 T_anchor_robot;
    // Covariance of T_anchor_robot, in the anchor's frame.
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.anchor, self.T_anchor_robot, self.covariance);
    }
  };
  // Whether all indices lie within what they count, with this many keyframes.
  [[nodiscard]] bool IsConsistent(std::size_t keyframes) const;

  // A revisit as a measurement of the robot and of the anchor on which the old keyframe hangs.
  struct SeenFromAnchor {
    Innovation<3> innovation;
    Eigen::Index at = 0;  // First index of the anchor in the state.
    Eigen::Matrix3d J_z_anchor;
    Eigen::Matrix3d R;
  };
  [[nodiscard]] SeenFromAnchor SeeFromAnchor(const RevisitObservation& revisit) const;
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
    Eigen::Index at = 0;  // First index in the state.
    std::size_t keyframe = 0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.at, self.keyframe);
    }
  };
  std::vector<Anchor> anchors_;
  std::vector<Hung> keyframes_;
  Hung since_anchor_;
  double since_anchor_m_ = 0.0;
  bool moved_path_ = false;  // Whether an update in this step corrected past poses.
  PosePath path_;
  Contradictions contradictions_;
  StepNis nis_;
};

}  // namespace cairn::slam
