// One level of DP-SLAM: a particle filter over poses whose particles have maps. One step of the low level is
// Move and then Observe with a scan. The high level (segment_filter.h) composes its step from the parts
// below. Poses are T_map_robot in the frame of this level. Not thread-safe; deterministic for a seed, on any
// number of threads.
// Source: Eliazar, Parr 2003, 2004, 2005 (hierarchical); thesis C 3.2.3, 4.5.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/slam/dpslam/particle_maps.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/random/resampling.h"
#include "server/slam/trail/pose_path.h"

namespace cairn::slam {

struct LevelOptions {
  std::int64_t particles = 500;
  double sigma_m = 0.05;
  double evidence_share = 0.15;
  double outlier_share = 0.05;
  double unseen_per_m = 2.0;    // Density of the ends of rays in unseen space: that of a well explained ray.
  double resample_below = 1.0;  // Resample after every scan, as in the source.
  std::int64_t ray_stride = 1;
  double give_up_behind = 12.0;
  // Low level: noise of a step in addition to the front-end's covariance. High level: the largest noise of a
  // segment at its joint that particles draw.
  MotionNoise drift{0.004, 0.05, 0.01, 0.001, 0.01, 0.05};
};
void Visit(OptionVisitor& visitor, LevelOptions& options);  // Reads all fields but `particles` and `unseen_per_m`.

struct GridParticle {
  Pose2 T_map_robot;
  std::size_t map = 0;          // Index in ParticleMaps.
  double log_weight = 0.0;      // Log weight since the last resampling.
  double log_likelihood = 0.0;  // Log likelihood of the whole path; not reset by resampling.
  double log_prior = 0.0;       // Log density of the drift at its joints (high level only).
  PosePath path;                // T_map_robot at every observed scan.

  [[nodiscard]] double log_posterior() const { return log_likelihood + log_prior; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.T_map_robot, self.map, self.log_weight, self.log_likelihood, self.log_prior, self.path);
  }
};

class LevelFilter {
 public:
  LevelFilter(const LevelOptions& options, const OpacityOptions& opacity, const Pose2& T_map_robot_start);

  // Moves every particle by the step with noise of this covariance: (x, y, theta) in the frame the step
  // starts from.
  void Move(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev, Rng& rng) {
    Move([&] { return T_prev_curr; }, T_prev_curr, covariance_prev, rng);
  }
  // The same with a separate step for every particle, drawn in their order; `T_mean` is the mean of the
  // steps.
  void Move(const std::function<Pose2()>& draw_step, const Pose2& T_mean, const Eigen::Matrix3d& covariance_prev,
            Rng& rng);
  // Removes from all maps what is farther from the robot.
  void KeepNear(double radius_m) { maps_.KeepNear(mean_.translation(), radius_m); }
  // Weights the particles, resamples them and draws the evidence into their maps. The new pose of a particle
  // is the last pose of the evidence. If the evidence has no rays, only the paths grow.
  void Observe(const Evidence& evidence, Rng& rng, const ParallelFor& parallel_for);

  // Parts of a step, for the high level. A sample is the placement of the evidence by one particle; samples
  // are in the order of the particles.

  // Returns the log likelihood of each sample. The samples may belong to some of the particles only.
  [[nodiscard]] std::vector<double> LogLikelihoods(std::span<const MapSample> samples,
                                                   std::span<const Evidence> alternatives,
                                                   const ParallelFor& parallel_for) const;
  // Equal samples are drawn once and share the map.
  struct Drawings {
    std::vector<MapSample> distinct;
    std::vector<std::size_t> of_particle;  // Index in `distinct` for each particle.

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.distinct, self.of_particle);
    }
  };
  [[nodiscard]] static Drawings Distinct(std::span<const MapSample> samples);
  // Replaces the particles by those after a step, with weights; their maps are still the old ones. REQUIRES:
  // the same number of particles, ordered by map.
  void Replace(std::vector<GridParticle> particles);
  // Gives the particles the new maps of `children`. REQUIRES: one child for each distinct sample.
  void Adopt(const Drawings& drawings, std::vector<Ancestry::Child> children);

  [[nodiscard]] const std::vector<GridParticle>& particles() const { return particles_; }
  [[nodiscard]] std::vector<double> weights() const;  // Normalised weights.
  [[nodiscard]] const GridParticle& best() const { return particles_[best_]; }
  [[nodiscard]] std::size_t best_index() const { return best_; }
  [[nodiscard]] const LevelOptions& options() const { return options_; }
  [[nodiscard]] const ParticleMaps& maps() const { return maps_; }
  // Weighted mean and covariance of the particles near the best one, before resampling.
  [[nodiscard]] const Pose2& mean() const { return mean_; }
  [[nodiscard]] const Eigen::Matrix3d& covariance() const { return covariance_; }
  [[nodiscard]] double effective_sample_size() const { return effective_; }
  // Log likelihood per ray of the last evidence at its best placement, minus that in unseen space: well below
  // 0 if the map contradicts the evidence. 0 if there was nothing to compare.
  [[nodiscard]] double gain() const { return gain_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    const std::size_t count = self.particles_.size();
    archive(self.maps_, self.particles_, self.best_, self.mean_, self.covariance_, self.effective_, self.gain_);
    bool sound = self.particles_.size() == count && self.best_ < count;
    std::size_t map = 0;
    for (const GridParticle& particle : self.particles_) {
      sound = sound && map <= particle.map && particle.map < self.maps_.count() &&
              particle.path.size() == self.particles_.front().path.size();
      map = particle.map;
    }
    archive.Require(sound, "the particles with maps");
  }

 private:
  [[nodiscard]] RayModel Model() const;
  [[nodiscard]] double GainOf(const Evidence& evidence, double log_likelihood) const;
  // Computes the best particle, mean and covariance; returns the weights.
  std::vector<double> Summarise();

  const LevelOptions options_;
  ParticleMaps maps_;
  std::vector<GridParticle> particles_;  // The particles, ordered by map.
  std::size_t best_ = 0;
  Pose2 mean_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  double effective_ = 0.0;
  double gain_ = 0.0;
};

}  // namespace cairn::slam
