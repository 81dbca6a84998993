#include "server/slam/dpslam/dpslam.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace cairn::slam {
namespace {

// Gain per ray: as where one ray in four ends in what the map says is free.
constexpr double kContradiction = -1.0;

}  // namespace

DpSlam::DpSlam(const DpSlamOptions& options, const Pose2& T_map_robot_start, std::uint64_t seed)
    : options_(options), rng_(seed) {
  low_.emplace(options_.low, options_.opacity, options_.hierarchical ? Pose2{} : T_map_robot_start);
  if (options_.hierarchical) high_.emplace(options_.high, options_.opacity, T_map_robot_start);
}

void DpSlam::Predict(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev) {
  low_->Move(T_prev_curr, covariance_prev + options_.low.drift.Covariance(T_prev_curr), rng_);
  segment_m_ += T_prev_curr.translation().norm();
  turned_rad_ = std::abs(T_prev_curr.theta);
}

void DpSlam::Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) {
  Observe(std::make_shared<LaserRays>(RaysOf(sight.scan, options_.opacity)), parallel_for);
}

void DpSlam::Observe(std::shared_ptr<const LaserRays> rays, const ParallelFor& parallel_for) {
  const Evidence evidence{{rays, Pose2{}}};
  low_->Observe({&evidence, 1}, rng_, parallel_for);
  observed_ = true;
  contradicted_ = low_->gain() < kContradiction ? contradicted_ + 1 : 0;
  if (!options_.hierarchical) return;
  segment_.push_back(std::move(rays));
  if (SegmentEnds()) EndSegment(parallel_for);
}

void DpSlam::Commit() {
  if (!observed_) Observe(std::make_shared<LaserRays>(), SerialFor);
  observed_ = false;
}

bool DpSlam::SegmentEnds() const {
  // Thesis C 6.1: after a way, not after a number of scans (the robot may stand in one room for hundreds), and not
  // within a fast turn, after which the next segment shares too little with this one.
  return static_cast<std::int64_t>(segment_.size()) >= options_.segment.max_scans ||
         (segment_m_ >= options_.segment.length_m && turned_rad_ <= options_.segment.straight_rad);
}

void DpSlam::EndSegment(const ParallelFor& parallel_for) {
  // Trajectories from the distribution the low level ends with: its best one first.
  const auto along = [&](const GridParticle& particle) {
    Evidence evidence;
    evidence.reserve(segment_.size());
    for (std::size_t k = 0; k < segment_.size(); ++k) evidence.push_back({segment_[k], particle.path[k]});
    return evidence;
  };
  std::vector<Evidence> trajectories{along(low_->best())};
  const auto count = static_cast<std::size_t>(options_.segment.trajectories);
  const std::vector<GridParticle>& particles = low_->particles();
  for (std::size_t t = 1; t < count; ++t) trajectories.push_back(along(particles[t * particles.size() / count]));

  // The drift of a whole segment, at the joint where it begins (thesis C 4.5.2). The first one is simply drawn.
  if (!high_->maps().blank()) high_->Move({}, options_.high.drift.Covariance({segment_m_, 0.0, 0.0}), rng_);
  high_->Observe(trajectories, rng_, parallel_for);

  // The next segment starts here, with the last scans drawn on its map.
  const Evidence& best = trajectories.front();
  const Pose2 T_segment_end = best.back().T_start_robot;
  Evidence tail;
  const std::size_t overlap = std::min(best.size(), static_cast<std::size_t>(options_.segment.overlap_scans));
  for (std::size_t k = best.size() - overlap; k < best.size(); ++k)
    tail.push_back({best[k].rays, Between(T_segment_end, best[k].T_start_robot)});
  low_.emplace(options_.low, options_.opacity, Pose2{});
  low_->Draw(tail, parallel_for);
  segment_.clear();
  segment_m_ = 0.0;
}

FilterEstimate DpSlam::estimate() const {
  if (!high_) return {low_->mean(), low_->covariance()};
  const Pose2 &T_map_segment = high_->mean(), &T_segment_robot = low_->mean();
  const Eigen::Matrix3d J_left = J_compose_left(T_map_segment, T_segment_robot);
  const Eigen::Matrix3d J_right = J_compose_right(T_map_segment, T_segment_robot);
  return {T_map_segment * T_segment_robot,
          J_left * high_->covariance() * J_left.transpose() + J_right * low_->covariance() * J_right.transpose()};
}

FilterHealth DpSlam::health() const {
  FilterHealth health;
  health.effective_sample_size = low_->effective_sample_size();
  health.diverged = contradicted_ >= options_.diverged_after;
  return health;
}

std::size_t DpSlam::hypothesis_count() const {
  return (high_ ? *high_ : *low_).particles().size();
}

Hypothesis DpSlam::hypothesis(std::size_t index) const {
  const LevelFilter& level = high_ ? *high_ : *low_;
  const std::size_t best = level.best_index();
  const GridParticle& particle = level.particles()[index == 0 ? best : index <= best ? index - 1 : index];
  if (!high_) return {particle.T_map_robot, particle.path};
  // The unfinished segment goes along rigidly.
  const GridParticle& low = low_->best();
  Hypothesis result{particle.T_map_robot * low.T_map_robot, particle.path};
  for (std::size_t k = 0; k < low.path.size(); ++k) result.path.Append(particle.T_map_robot * low.path[k]);
  return result;
}

OccupancyImage DpSlam::MapImage() const {
  const LevelFilter& level = high_ ? *high_ : *low_;
  return level.maps().Image(level.best().map);
}

std::size_t DpSlam::bytes() const {
  return low_->maps().ancestry().bytes() + (high_ ? high_->maps().ancestry().bytes() : 0);
}

}  // namespace cairn::slam
