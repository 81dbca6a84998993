// FastSLAM 2.0: a particle filter over the robot's path whose particles carry their own landmark maps, and whose
// proposal takes the latest observation into account before it samples. Two kinds of observation: landmarks with two
// positions each (FS_2LS_2LP), and revisits: the robot's place relative to an old keyframe, measured by matching scans.
// Between observations a particle moves along the matched motion and only its uncertainty grows; it is sampled when an
// observation arrives, when a landmark is new, or when `sample_distance_m` has been travelled.
// Frames: T_map_robot; measurements in `robot` (landmarks) or in the old keyframe's robot frame (revisits).
// Not thread-safe. Deterministic for a seed.
// Source: thesis A chapter 4; Montemerlo 2003. Misprints put right are named where they matter.
#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "server/slam/filters/filter.h"
#include "server/slam/filters/landmark_observation.h"
#include "server/slam/filters/landmark_tracker.h"
#include "server/slam/filters/particle.h"
#include "server/slam/filters/resampling.h"
#include "server/slam/motion/motion_noise.h"

namespace cairn::slam {

struct FastSlamOptions {
  MotionNoise drift{0.002, 0.01, 0.005, 0.0005, 0.002, 0.005};
  double sample_distance_m = 1.0;  // Travelled before uncertainty is sampled without an observation.
  double resample_below = 0.5;     // Effective sample size over particles.
  double max_nis = 16.0;           // Squared Mahalanobis distance beyond which an observation adds no more doubt.
  double agreement_m = 0.5;        // Particles this near the best one take part in the reported pose.
  LandmarkNoise landmark;
};
void Visit(OptionVisitor& visitor, FastSlamOptions& options);

class FastSlam2 final : public Filter {
 public:
  FastSlam2(const FastSlamOptions& options, const LandmarkOptions& landmarks, std::int64_t particles,
            const Pose2& T_map_robot_start, std::uint64_t seed);

  // Prediction (Table 4.2): moves every particle along the matched motion and lets its uncertainty grow.
  void Predict(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev) override;
  // Proposal and weight for one revisit (Tables 4.6, 4.8). False where no particle explains it: nothing changes.
  bool Observe(const RevisitObservation& revisit) override;
  void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) override;
  // Proposal, weights, landmark updates and new landmarks of one scan (Tables 4.4-4.8).
  void Observe(std::span<const LandmarkObservation> sightings);
  // Ends the step: samples where due, appends the pose to every path, resamples where too few particles count.
  void Commit() override;
  bool Rebase(std::span<const Pose2> path) override;

  [[nodiscard]] const Particle& best() const { return particles_[best_]; }
  [[nodiscard]] const std::vector<Particle>& particles() const { return particles_; }
  [[nodiscard]] std::size_t landmark_count() const { return landmark_count_; }
  // Weighted mean pose of the particles that agree with the best one, and their spread plus its own uncertainty.
  // Steadier than the best particle, which changes hands.
  [[nodiscard]] FilterEstimate estimate() const override { return estimate_; }
  [[nodiscard]] FilterHealth health() const override { return {effective_, 0.0, 0, false}; }
  // The best particle, then every particle.
  [[nodiscard]] std::size_t hypothesis_count() const override { return particles_.size() + 1; }
  [[nodiscard]] Hypothesis hypothesis(std::size_t index) const override;
  [[nodiscard]] std::vector<Landmark> landmarks() const override;

 private:
  void Sample(Particle& particle);
  std::vector<double> Resample();
  void Summarise(const std::vector<double>& weights);

  FastSlamOptions options_;
  LandmarkTracker tracker_;
  Rng rng_;
  std::vector<Particle> particles_;
  std::size_t best_ = 0;
  std::size_t landmark_count_ = 0;
  double travelled_ = 0.0;  // Since the last sampling.
  bool sample_due_ = false;
  double effective_ = 0.0;
  FilterEstimate estimate_;
};

}  // namespace cairn::slam
