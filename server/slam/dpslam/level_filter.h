// One level of DP-SLAM: a particle filter over poses whose particles own maps. One step of the low level is Move, then
// Observe a scan. The high level (segment_filter.h) makes its step of the parts. Poses are T_map_robot in the
// frame of this level. Not thread-safe; deterministic for a seed, on any number of threads.
// Source: Eliazar, Parr 2003, 2004, 2005 (hierarchical); thesis C 3.2.3, 4.5.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/slam/dpslam/particle_maps.h"
#include "server/slam/filters/resampling.h"
#include "server/slam/filters/shared_sequence.h"
#include "server/slam/motion/motion_noise.h"

namespace cairn::slam {

struct LevelOptions {
  std::int64_t particles = 500;
  double sigma_m = 0.05;         // Of a range against the map. Larger: more particles agree.
  double evidence_share = 0.15;  // Of a ray's log likelihood: neighbouring rays hit the same wall and err alike.
  double outlier_share = 0.05;   // Rays that say nothing about the map: people, open doors.
  double unseen_per_m = 2.0;     // Density of ray ends in unseen space; about that of a ray well explained.
  double resample_below = 1.0;   // Effective sample size over particles; 1: after every scan, as the source does.
  std::int64_t ray_stride = 1;   // Every n-th ray judges; all are drawn.
  double give_up_behind =
      12.0;                  // Weighted log likelihood behind the best at which a particle is not looked at further.
  double agreement_m = 0.5;  // Particles this near the best one take part in the reported pose.
  // Low: of a step, on top of what the front-end says. High: of a segment, at its joint; the most that particles draw.
  MotionNoise drift{0.004, 0.05, 0.01, 0.001, 0.01, 0.05};
};
void Visit(OptionVisitor& visitor, LevelOptions& options);  // All but `particles`.

struct GridParticle {
  Pose2 T_map_robot;
  std::size_t map = 0;          // Of ParticleMaps.
  double log_weight = 0.0;      // Since the last resampling.
  double log_likelihood = 0.0;  // Of the whole path; survives resampling.
  double log_prior = 0.0;       // Of the drift at its joints, in the high level.
  SharedSequence<Pose2> path;   // T_map_robot at every scan observed.

  [[nodiscard]] double log_posterior() const { return log_likelihood + log_prior; }
};

class LevelFilter {
 public:
  LevelFilter(const LevelOptions& options, const OpacityOptions& opacity, const Pose2& T_map_robot_start);

  // Moves every particle by the step with noise of this covariance: (x, y, theta) in the frame the step starts from.
  void Move(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev, Rng& rng) {
    Move([&] { return T_prev_curr; }, T_prev_curr, covariance_prev, rng);
  }
  // The same by a step of its own for every particle, drawn in their order; `T_mean` is what the draws scatter about.
  void Move(const std::function<Pose2()>& draw_step, const Pose2& T_mean, const Eigen::Matrix3d& covariance_prev,
            Rng& rng);
  // All maps forget what is farther from the robot.
  void KeepNear(double radius_m) { maps_.KeepNear(mean_.translation(), radius_m); }
  // Every particle is weighted, survives or not, and draws the evidence; its last pose is where the particle then is.
  // Where it shows no ray, only the paths grow.
  void Observe(const Evidence& evidence, Rng& rng, const ParallelFor& parallel_for);

  // Parts of a step, for the high level. A sample is what one particle experiences, in the order of the particles.
  // Log likelihood of each of the samples, which may be some only.
  [[nodiscard]] std::vector<double> Judge(std::span<const MapSample> samples, std::span<const Evidence> alternatives,
                                          const ParallelFor& parallel_for) const;
  // Those alike draw once and share the map.
  struct Drawings {
    std::vector<MapSample> distinct;
    std::vector<std::size_t> of_particle;  // Index in `distinct`.
  };
  [[nodiscard]] static Drawings Distinct(std::span<const MapSample> samples);
  // The particles after a step, weighted; their maps are still those they had. REQUIRES: as many, ordered by map.
  void Replace(std::vector<GridParticle> particles);
  // Draws: from now on they own these maps. REQUIRES: a birth for each of the distinct.
  void Adopt(const Drawings& drawings, std::vector<Ancestry::Birth> births);

  [[nodiscard]] const std::vector<GridParticle>& particles() const { return particles_; }
  [[nodiscard]] const GridParticle& best() const { return particles_[best_]; }
  [[nodiscard]] std::size_t best_index() const { return best_; }
  [[nodiscard]] const LevelOptions& options() const { return options_; }
  [[nodiscard]] const ParticleMaps& maps() const { return maps_; }
  // Weighted mean of the particles that agree with the best one, and their spread, before they were resampled.
  [[nodiscard]] const Pose2& mean() const { return mean_; }
  [[nodiscard]] const Eigen::Matrix3d& covariance() const { return covariance_; }
  [[nodiscard]] double effective_sample_size() const { return effective_; }
  // Log likelihood per ray of the last evidence where it fits best, over what unseen space says: well below 0 where the
  // map contradicts it. 0 where there was nothing to compare.
  [[nodiscard]] double gain() const { return gain_; }

 private:
  [[nodiscard]] RayModel Model() const;
  [[nodiscard]] double GainOf(const Evidence& evidence, double log_likelihood) const;
  // Finds the best one, mean and spread; returns the weights.
  std::vector<double> Summarise();

  const LevelOptions options_;
  ParticleMaps maps_;
  std::vector<GridParticle> particles_;  // Ordered by map.
  std::size_t best_ = 0;
  Pose2 mean_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  double effective_ = 0.0;
  double gain_ = 0.0;
};

}  // namespace cairn::slam
