// The particles' poses and weights: prediction, the proposal from an observation, sampling, resampling, and the pose
// they report together. What they remember of landmarks is the filter's. Frames: T_map_robot; revisits in the old
// keyframe's robot frame. Between observations a particle moves along the matched motion and only its uncertainty
// grows; it is sampled when an observation arrives or when `sample_distance_m` has been travelled. Not thread-safe.
// Deterministic for a seed. Source: thesis A 4.3, Tables 4.2, 4.6, 4.8, 4.9; Montemerlo 2003.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/filters/error_ensemble.h"
#include "server/slam/filters/fastslam_options.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/innovation.h"
#include "server/slam/filters/particle.h"
#include "server/slam/filters/resampling.h"
#include "server/slam/filters/step_nis.h"

namespace cairn::slam {

class ParticleSet {
 public:
  // REQUIRES: count > 0.
  ParticleSet(const FastSlamOptions& options, double max_nis, std::int64_t count, const Pose2& T_map_robot_start,
              std::uint64_t seed);

  // Table 4.2: moves every particle along the step and lets its uncertainty grow. `covariance_prev` in the step's
  // start.
  void Predict(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  // FastSLAM 1.0: moves every particle by a sample of the motion model, and of what comes on top of it, which leaves no
  // uncertainty.
  void PredictBySampling(const StepMotion& measured);

  // Proposal and weight for one revisit. False where no particle explains it: nothing changes.
  bool Observe(const RevisitObservation& revisit);
  // Proposal and weight for one number or more of a landmark; the weight loses no more than `max_nis` allows.
  template <int N>
  void Fuse(std::size_t index, const Innovation<N>& innovation) {
    Particle& particle = particles_[index];
    const Eigen::Matrix<double, N, N> S = innovation.S(particle.covariance);
    const double nis = Nis<N>(innovation.v, S);
    Weigh(index, LogDensity<N>(std::min(nis, max_nis_), S));
    if (nis < max_nis_) CorrectPose<N>(particle.T_map_robot, particle.covariance, innovation);
  }
  // For the doubt about the estimate: an observation of something first seen from `keyframe`, as the best particle
  // has it.
  template <int N>
  void Tie(std::size_t keyframe, const Innovation<N>& innovation) {
    errors_.Tie<N>(keyframe, best().T_map_robot, innovation);
  }
  void Weigh(std::size_t index, double log_likelihood) {
    particles_[index].log_weight += log_likelihood;
    particles_[index].log_likelihood += log_likelihood;
  }
  // What the whole set made of an observation, for health().
  template <int N>
  void Judge(const MixtureInnovation<N>& innovation) {
    if (!innovation.empty()) nis_.Add(innovation.nis(), N);
  }
  [[nodiscard]] std::vector<double> weights() const;  // Normalised.
  // Draws the pose from N(xv, pv) and starts collecting uncertainty anew.
  void Sample(std::size_t index);
  void SampledAll() { travelled_ = 0.0; }

  // Ends the step: samples where due, appends the pose to every path, resamples where too few particles count. The
  // parents of the new set in order; empty where it stays as it is.
  [[nodiscard]] std::vector<int> Commit();
  // Every particle goes on from this path: what they disagreed about is decided.
  void Rebase(std::span<const Pose2> path);

  [[nodiscard]] const std::vector<Particle>& particles() const { return particles_; }
  [[nodiscard]] const Particle& operator[](std::size_t index) const { return particles_[index]; }
  [[nodiscard]] std::size_t size() const { return particles_.size(); }
  [[nodiscard]] std::size_t best_index() const { return best_; }
  [[nodiscard]] const Particle& best() const { return particles_[best_]; }
  // Weighted mean pose of the particles that agree with the best one, steadier than the best particle, which changes
  // hands; and how wrong it may be, which is more than the particles' spread (error_ensemble.h). Particles too far off
  // to be covered by that add their distance.
  [[nodiscard]] const FilterEstimate& estimate() const { return estimate_; }
  [[nodiscard]] FilterHealth health() const;

 private:
  std::vector<int> Resample(std::vector<double>& left);
  void Summarise(const std::vector<double>& shares);

  FastSlamOptions options_;
  double max_nis_;
  Rng rng_;
  std::vector<Particle> particles_;
  ErrorEnsemble errors_;
  double spread_share_ = 1.0;  // Of the variance of the pose: what the particles spread over.
  std::size_t best_ = 0;
  double travelled_ = 0.0;  // Since the last sampling.
  bool sample_due_ = false;
  double effective_ = 0.0;
  StepNis nis_;
  FilterEstimate estimate_;
};

}  // namespace cairn::slam
