#include "server/slam/dpslam/dpslam.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

// Gain per ray below which a scan contradicts the map: about that of a scan of which one ray in four ends in
// space that the map shows as free.
constexpr double kContradiction = -1.0;

// The low level continues for so many scans before it hands a segment up, because the best particle becomes clear only
// later. With robot 3 of the study `dpslam` and 60 + 60 particles, the heading after 100 m is 8.5 deg off without
// hindsight and 0.2 deg with it (one robot only). Half or twice the value changes the error on the first 600 scans of
// mit-csail by 1 % (study `sensitivity`).
constexpr std::size_t kHindsightScans = 10;

}  // namespace

DpSlam::DpSlam(const DpSlamOptions& options, const Pose2& T_map_robot_start, std::uint64_t seed)
    : options_(options),
      rng_(seed),
      low_(std::in_place, options_.low, options_.opacity, options_.hierarchical ? Pose2{} : T_map_robot_start) {
  if (!options_.hierarchical) return;
  if (options_.high_level == HighLevelKind::kPlain) {
    plain_.emplace(options_.high, options_.opacity, T_map_robot_start);
  } else {
    high_.emplace(options_.high, options_.opacity, options_.segment.keep_m, T_map_robot_start);
  }
}

bool DpSlam::IsConsistent(std::size_t keyframes) const {
  const std::size_t low = low_->best().path.size();
  if (!options_.hierarchical) return low == keyframes && pending_.empty();
  const std::size_t high = this->high()->best().path.size();
  const bool at_work = high_ && high_->at_work();
  return low == passed_on_ + pending_.size() && at_work == (at_work_ > 0) && at_work_ <= pending_.size() &&
         high + pending_.size() == keyframes;
}

void DpSlam::Predict(const StepMotion& step) {
  switch (options_.motion) {
    case LowMotion::kGaussian:
      low_->Move(step.T_prev_curr, step.covariance_prev + options_.low.drift.Covariance(step.T_prev_curr), rng_);
      break;
    case LowMotion::kEliazar: {
      const StepMotion input = step.ByOdometry();
      const EliazarModel& model = options_.learnt.eliazar;
      const OdometryStep odometry = StepOf(input.T_prev_curr);
      low_->Move([&] { return SampleMotion(model, odometry, rng_); }, MeanMotion(model, odometry),
                 input.covariance_prev, rng_);
      break;
    }
    case LowMotion::kScanMatching:
      low_->Move([&] { return SampleMotion(options_.learnt.scan_matching, step.T_prev_curr, step.lambda_m, rng_); },
                 step.T_prev_curr, step.covariance_prev, rng_);
      break;
  }
  step_m_ += step.T_prev_curr.translation().norm();
  turn_rad_ += std::abs(step.T_prev_curr.theta);
}

void DpSlam::Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) {
  Observe(std::make_shared<LaserRays>(RaysOf(sight.scan, options_.opacity)), parallel_for);
}

void DpSlam::Observe(std::shared_ptr<const LaserRays> rays, const ParallelFor& parallel_for) {
  const Evidence evidence{{rays, Pose2{}}};
  low_->Observe(evidence, rng_, parallel_for);
  observed_ = true;
  contradicted_ = low_->gain() < kContradiction ? contradicted_ + 1 : 0;
  if (!options_.hierarchical) return;
  pending_.push_back({std::move(rays), std::exchange(step_m_, 0.0), std::exchange(turn_rad_, 0.0)});
  if (plain_) {
    if (SegmentEnd() > 0) JoinPlainly(parallel_for);
    return;
  }
  if (high_->at_work()) {
    high_->Work(rng_, parallel_for);
    if (high_->at_work()) return;
    pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(at_work_));
    passed_on_ += std::exchange(at_work_, 0);
    T_low_joint_ = T_low_end_;
  }
  if (const std::size_t count = SegmentEnd(); count > 0) PassToHighLevel(count);
}

void DpSlam::Commit() {
  if (!observed_) Observe(std::make_shared<LaserRays>(), SerialFor);
  observed_ = false;
}

std::size_t DpSlam::SegmentEnd() const {
  const auto hindsight = plain_ ? 0 : kHindsightScans;
  if (pending_.size() <= hindsight) return 0;
  const std::size_t count = pending_.size() - hindsight;
  if (count >= static_cast<std::size_t>(options_.segment.max_scans)) return count;
  // Thesis C 6.1: a segment ends after a distance, not after a number of scans (the robot may stand in one
  // room for hundreds), and not within a fast turn, after which the next segment has too little in common
  // with this one.
  return WayOf(count) >= options_.segment.length_m &&
                 pending_[std::min(count, pending_.size() - 1)].turn_rad <= options_.segment.straight_rad
             ? count
             : 0;
}

double DpSlam::WayOf(std::size_t count) const {
  double way_m = 0.0;
  for (std::size_t k = 0; k < count; ++k) way_m += pending_[k].step_m;
  return way_m;
}

// The scans are relative to the end of the last segment in the low level's frame as it was then, not as the
// particle now has it. In this way a later correction by the low level is passed on and not lost.
Evidence DpSlam::Along(const GridParticle& particle, std::size_t count) const {
  const Pose2 T_joint_low = T_low_joint_.Inverse();
  Evidence evidence;
  evidence.reserve(count);
  for (std::size_t k = 0; k < count; ++k)
    evidence.push_back({pending_[k].rays, T_joint_low * particle.path[passed_on_ + k]});
  return evidence;
}

// Thesis C 4.5.2, Figures 4.19 and 4.24: the first segment is drawn where it is; every other one begins at an
// end pose to which each particle adds drift. Then the low level begins again with the scan at the joint as
// its first map.
void DpSlam::JoinPlainly(const ParallelFor& parallel_for) {
  const std::size_t count = pending_.size();
  const Evidence segment = Along(low_->best(), count);
  if (!plain_->maps().blank()) plain_->Move(Pose2{}, options_.high.drift.Covariance({WayOf(count), 0.0, 0.0}), rng_);
  plain_->Observe(segment, rng_, parallel_for);
  low_.emplace(options_.low, options_.opacity, Pose2{});
  low_->Observe({{segment.back().rays, Pose2{}}}, rng_, parallel_for);
  pending_.clear();
  passed_on_ = 1;
  T_low_joint_ = Pose2{};
}

void DpSlam::PassToHighLevel(std::size_t count) {
  // Trajectories sampled from the present distribution of the low level, its best one first.
  std::vector<Evidence> trajectories{Along(low_->best(), count)};
  const auto alternatives = static_cast<std::size_t>(options_.segment.trajectories);
  const std::vector<GridParticle>& particles = low_->particles();
  for (std::size_t t = 1; t < alternatives; ++t)
    trajectories.push_back(Along(particles[t * particles.size() / alternatives], count));

  high_->Take(std::move(trajectories), WayOf(count), rng_);
  at_work_ = count;
  T_low_end_ = low_->best().path[passed_on_ + count - 1];
  low_->KeepNear(options_.segment.keep_m);
}

FilterEstimate DpSlam::estimate() const {
  if (!options_.hierarchical) return {low_->mean(), low_->covariance()};
  // The pose of the best particle, not the mean of its neighbours, whose random drift would be visible in the
  // mean.
  const LevelFilter& high = *this->high();
  const Pose2 T_map_segment = high.best().T_map_robot, T_segment_robot = Between(T_low_joint_, low_->mean());
  const Eigen::Vector3d off = Minus(high.mean(), T_map_segment);
  const Eigen::Matrix3d covariance = high.covariance() + off * off.transpose();
  const Eigen::Matrix3d J_left = J_compose_left(T_map_segment, T_segment_robot);
  // The low level's covariance is in the low level's own frame.
  const Pose2 T_map_low = T_map_segment * T_low_joint_.Inverse();
  const Eigen::Matrix3d J_low = J_compose_right(T_map_low, low_->mean());
  return {T_map_segment * T_segment_robot,
          J_left * covariance * J_left.transpose() + J_low * low_->covariance() * J_low.transpose()};
}

FilterHealth DpSlam::health() const {
  FilterHealth health;
  health.effective_sample_size = low_->effective_sample_size();
  health.diverged = contradicted_ >= options_.diverged_after;
  return health;
}

std::size_t DpSlam::hypothesis_count() const {
  return (high() != nullptr ? *high() : low()).particles().size();
}

Hypothesis DpSlam::hypothesis(std::size_t index) const {
  const LevelFilter& level = high() != nullptr ? *high() : low();
  const std::size_t best = level.best_index();
  const GridParticle& particle = level.particles()[index == 0 ? best : index <= best ? index - 1 : index];
  if (high() == nullptr) return {particle.T_map_robot, particle.path};
  // The pending scans follow rigidly.
  const GridParticle& low = low_->best();
  const Pose2 T_map_low = particle.T_map_robot * T_low_joint_.Inverse();
  Hypothesis result{T_map_low * low.T_map_robot, particle.path};
  for (std::size_t k = passed_on_; k < low.path.size(); ++k) result.path.Append(T_map_low * low.path[k]);
  return result;
}

std::vector<WeightedPose> DpSlam::belief() const {
  const LevelFilter& level = high() != nullptr ? *high() : low();
  // The pending scans follow rigidly.
  const Pose2 T_joint_robot = high() != nullptr ? Between(T_low_joint_, low_->best().T_map_robot) : Pose2{};
  std::vector<WeightedPose> belief;
  for (const double weight : level.weights())
    belief.push_back({level.particles()[belief.size()].T_map_robot * T_joint_robot, weight});
  return belief;
}

OccupancyImage DpSlam::MapImage() const {
  if (high_) return high_->MapImage();
  const LevelFilter& level = plain_ ? *plain_ : *low_;
  return level.maps().Image(level.best().map);
}

std::size_t DpSlam::bytes() const {
  return low_->maps().ancestry().bytes() + (high_ ? high_->bytes() : 0) +
         (plain_ ? plain_->maps().ancestry().bytes() : 0);
}

}  // namespace cairn::slam
