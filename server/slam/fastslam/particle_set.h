// The poses and weights of the particles: prediction, the proposal from an observation, sampling, resampling,
// and the reported estimate. The filter stores their landmarks. Frames: T_map_robot; revisits in the robot
// frame of the old keyframe. Between observations a particle moves along the matched motion and only its
// covariance grows; its pose is sampled when an observation arrives or when `sample_distance_m` has been
// travelled, closer to the mean than the covariance says (`drawn_share`, README.md). Not thread-safe. Deterministic for
// a given seed. Source: thesis A 4.3, Tables 4.2, 4.6, 4.8, 4.9; Montemerlo 2003.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/fastslam/error_ensemble.h"
#include "server/slam/fastslam/motion_sampler.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/filter_health.h"
#include "server/slam/landmarks/innovation.h"
#include "server/slam/random/resampling.h"
#include "server/slam/trail/pose_path.h"

namespace cairn::slam {

struct FastSlamOptions {
  double sample_distance_m = 1.0;
  double drawn_share = 0.5;
  double resample_below = 0.5;
};
void Visit(OptionVisitor& visitor, FastSlamOptions& options);

// One hypothesis of a particle filter: the pose of the robot and the path to it. The filter stores the
// landmarks of each particle separately. Copies share the path until they differ. Poses in `map`.
// Source: thesis A 4.1, (4-1); Montemerlo 2003 (FastSLAM 2.0).
struct Particle {
  Pose2 T_map_robot;  // Pose of the robot; xv in the thesis.
  // pv: covariance of the motion not yet sampled, (x, y, theta) in map.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double log_weight = 0.0;      // Sum since the last resampling.
  double log_likelihood = 0.0;  // Log likelihood of the whole path; resampling keeps it.
  PosePath path;                // T_map_robot at every keyframe.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.T_map_robot, self.covariance, self.log_weight, self.log_likelihood, self.path);
  }
};

class ParticleSet {
 public:
  // `sampler` is needed for PredictBySampling only. REQUIRES: count > 0.
  ParticleSet(const FastSlamOptions& options, std::int64_t count, const Pose2& T_map_robot_start, std::uint64_t seed,
              MotionSampler sampler = {});

  // Moves every particle along the step and increases its covariance (Table 4.2). `covariance_prev` is in the
  // frame in which the step starts.
  void Predict(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev);
  // FastSLAM 1.0: moves every particle by a sample of the motion model and of any further noise of the step,
  // so that no covariance remains. REQUIRES: samples_motion().
  void PredictBySampling(const StepMotion& measured);
  [[nodiscard]] bool samples_motion() const { return sampler_.draw != nullptr; }

  // Puts every particle where the robot was found, with this doubt (filter.h: GoOnAt). Their weights stay, because this
  // says nothing of the way before.
  void GoOnAt(const FilterEstimate& place);

  // Proposal and weight for one revisit. False if no particle explains it; then nothing changes.
  bool Observe(const RevisitObservation& revisit);
  // Proposal and weight for one innovation of a landmark. Its squared Mahalanobis distance counts at most as
  // kMaxNis in the weight.
  template <int N>
  void Fuse(std::size_t index, const Innovation<N>& innovation) {
    Particle& particle = particles_[index];
    const Eigen::Matrix<double, N, N> S = innovation.S(particle.covariance);
    const double nis = Nis<N>(innovation.v, S);
    AddLogLikelihood(index, LogDensity<N>(std::min(nis, kMaxNis<N>), S));
    if (nis < kMaxNis<N>) CorrectPose<N>(particle.T_map_robot, particle.covariance, innovation);
  }
  // Updates the error ensemble with an observation of something first seen from `keyframe`. `innovation` is
  // that of the best particle.
  template <int N>
  void Constrain(std::size_t keyframe, const Innovation<N>& innovation) {
    errors_.Constrain<N>(keyframe, best().T_map_robot, innovation);
  }
  void AddLogLikelihood(std::size_t index, double log_likelihood) {
    particles_[index].log_weight += log_likelihood;
    particles_[index].log_likelihood += log_likelihood;
  }
  // Adds the innovation of the whole set to the sum that health() returns.
  template <int N>
  void AddInnovation(const MixtureInnovation<N>& innovation) {
    if (!innovation.empty()) nis_.Add(innovation.nis(), N);
  }
  [[nodiscard]] std::vector<double> weights() const;  // Normalised weights.
  [[nodiscard]] std::vector<WeightedPose> belief() const;
  // Draws the pose of a particle from N(xv, drawn_share^2 pv) and sets its covariance to zero.
  void Sample(std::size_t index) { Draw(index, options_.drawn_share); }
  void SampledAll() { travelled_ = 0.0; }

  // Ends the step: samples the particles if that is due, appends the pose to every path, and resamples if the
  // effective sample size is too small. Returns the parents of the new set in order; empty if there was no
  // resampling.
  [[nodiscard]] std::vector<int> Commit();
  // Replaces the path of every particle by this one. All particles are equal afterwards.
  void Rebase(std::span<const Pose2> path);
  // Moves the best particle to this path, and the others with it (filter.h: MoveTo). Returns by what each keyframe has
  // moved.
  std::vector<Pose2> MoveTo(std::span<const Pose2> path);
  // Leaves out keyframes of all paths.
  void Retire(const Retirement& retirement);

  [[nodiscard]] const std::vector<Particle>& particles() const { return particles_; }
  [[nodiscard]] const Particle& operator[](std::size_t index) const { return particles_[index]; }
  [[nodiscard]] std::size_t size() const { return particles_.size(); }
  // The most likely particle of those near the estimate.
  [[nodiscard]] std::size_t best_index() const { return best_; }
  [[nodiscard]] const Particle& best() const { return particles_[best_]; }
  // The weighted mean pose of the particles around the most likely one, as far as the doubt reaches. It changes less
  // from step to step than the most likely particle does, because another one may become the most likely. Its
  // covariance is larger than the spread of the particles (error_ensemble.h). Particles too far away to be covered by
  // it add their distance to the covariance.
  [[nodiscard]] const FilterEstimate& estimate() const { return estimate_; }
  [[nodiscard]] FilterHealth health() const;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    const std::size_t count = self.size();
    Later particles{self.particles_};
    archive(self.rng_, particles, self.errors_, self.spread_share_, self.best_, self.travelled_, self.sample_due_,
            self.effective_, self.nis_, self.estimate_);
    archive.Require(self.size() == count && self.best_ < count, "the particles");
  }

 private:
  // Draws the pose of a particle with this share of its standard deviations.
  void Draw(std::size_t index, double share);
  std::vector<int> Resample(std::vector<double>& left);
  // How many poses of their paths all particles share.
  [[nodiscard]] std::size_t SharedByAll() const;
  // Replaces every path by poses 0..size-1 that pose(old path, index) returns. Those before `apart` are the same for
  // all particles; they are made once, so that all share them again.
  template <typename MakePose>
  void RemakePaths(std::size_t size, std::size_t apart, const MakePose& pose);
  void Summarise(const std::vector<double>& shares);
  // The most likely particle of all, or, if another place has more than twice the weight of its place, the most likely
  // one there. Two particles are at one place if the squared Mahalanobis distance between their positions, with the
  // covariance `apart`, is at most kMaxNis.
  [[nodiscard]] std::size_t MostLikelyWhereTheWeightIs(std::size_t likeliest, const std::vector<double>& shares,
                                                       const Eigen::Matrix2d& apart) const;
  // Of the particles near a pose the one whose whole path is the most likely; if none is near, the nearest one.
  [[nodiscard]] std::size_t MostLikelyNear(const Pose2& T_map_robot) const;

  FastSlamOptions options_;
  MotionSampler sampler_;
  Rng rng_;
  std::vector<Particle> particles_;
  ErrorEnsemble errors_;
  double spread_share_ = 1.0;  // Share of the pose's variance over which the particles spread.
  std::size_t best_ = 0;
  double travelled_ = 0.0;  // Distance since the last sampling.
  bool sample_due_ = false;
  double effective_ = 0.0;
  StepNis nis_;
  FilterEstimate estimate_;
};

}  // namespace cairn::slam
