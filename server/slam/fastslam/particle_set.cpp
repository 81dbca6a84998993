#include "server/slam/fastslam/particle_set.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/geometry/pose_difference.h"
#include "common/geometry/rotated_covariance.h"
#include "server/slam/filters/revisit_innovation.h"
#include "server/slam/motion/odometry_model.h"

namespace cairn::slam {
namespace {

// Particles this near to the most likely one always take part in the reported pose, in metres. The path that is
// believed ends this near to that pose, if any does.
constexpr double kAgreementM = 0.5;

}  // namespace

void Visit(OptionVisitor& visitor, FastSlamOptions& options) {
  visitor.Real("sample_distance_m", options.sample_distance_m, "m", 0.0, 1000.0,
               "FastSLAM 2.0 draws the motion of a particle without an observation after this way.");
  visitor.Real(
      "drawn_share", options.drawn_share, "1", 0.0, 1.0,
      "FastSLAM 2.0 draws with this share of the standard deviations. 1 draws as theses A and C print it; with "
      "less, the path of each particle has less noise, and they spread less.");
  visitor.Real("resample_below", options.resample_below, "1", 0.0, 1.0,
               "The particles are resampled when the effective sample size falls below this share of their number.");
}

ParticleSet::ParticleSet(const FastSlamOptions& options, std::int64_t count, const Pose2& T_map_robot_start,
                         std::uint64_t seed, MotionSampler sampler)
    : options_(options),
      sampler_(std::move(sampler)),
      rng_(seed),
      particles_(static_cast<std::size_t>(count)),
      errors_(~seed) {
  for (Particle& particle : particles_) particle.T_map_robot = T_map_robot_start;
  effective_ = static_cast<double>(particles_.size());
  estimate_.T_map_robot = T_map_robot_start;
}

void ParticleSet::Predict(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev) {
  errors_.Move(best().T_map_robot, T_prev_curr, covariance_prev);
  const OdometryControl control = InverseOdometry(T_prev_curr);
  for (Particle& particle : particles_)
    DeadReckon(particle.T_map_robot, particle.covariance, T_prev_curr, control, covariance_prev);
  travelled_ += T_prev_curr.translation().norm();
}

void ParticleSet::PredictBySampling(const StepMotion& measured) {
  const StepMotion step = sampler_.input(measured);
  errors_.MoveBySampling(best().T_map_robot, step, sampler_);
  const bool more = step.covariance_prev.trace() > 0.0;
  if (more) errors_.Move(best().T_map_robot, step.T_prev_curr, step.covariance_prev);
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    Particle& particle = particles_[i];
    const Pose2 before = particle.T_map_robot;
    particle.T_map_robot = sampler_.draw(before, step, rng_);
    if (!more) continue;
    const Eigen::Matrix3d J = J_compose_right(before, step.T_prev_curr);
    particle.covariance = J * step.covariance_prev * J.transpose();
    Draw(i, 1.0);
  }
}

void ParticleSet::GoOnAt(const FilterEstimate& place) {
  errors_.Begin(place.T_map_robot, place.covariance);
  for (Particle& particle : particles_) {
    particle.T_map_robot = place.T_map_robot;
    particle.covariance = place.covariance;
  }
  sample_due_ = true;
}

bool ParticleSet::Observe(const RevisitObservation& revisit) {
  std::vector<Innovation<3>> innovations;
  innovations.reserve(particles_.size());
  double nearest = std::numeric_limits<double>::infinity();
  for (const Particle& particle : particles_) {
    innovations.push_back(InnovateRevisit(particle.path[revisit.keyframe], particle.T_map_robot, revisit));
    nearest = std::min(nearest, Nis<3>(innovations.back().v, innovations.back().S(particle.covariance)));
  }
  if (!(nearest < kMaxNis<3>)) return false;
  MixtureInnovation<3> mixture;
  const std::vector<double> before = weights();
  for (std::size_t i = 0; i < particles_.size(); ++i)
    mixture.Add(before[i], innovations[i].v, innovations[i].S(particles_[i].covariance));
  AddInnovation(mixture);
  Innovation<3> alike = innovations[best_];
  alike.S_known_pose *= static_cast<double>(1 + revisit.alike);
  Constrain<3>(revisit.keyframe, alike);
  for (std::size_t i = 0; i < particles_.size(); ++i) Fuse<3>(i, innovations[i]);
  sample_due_ = true;
  return true;
}

std::vector<int> ParticleSet::Commit() {
  if (sample_due_ || travelled_ >= options_.sample_distance_m) {
    for (std::size_t i = 0; i < particles_.size(); ++i) Sample(i);
    travelled_ = 0.0;
    sample_due_ = false;
  }
  for (Particle& particle : particles_) particle.path.Append(particle.T_map_robot);
  errors_.Keep(spread_share_);
  std::vector<double> left;
  std::vector<int> parents = Resample(left);
  Summarise(left);
  nis_.EndStep();
  return parents;
}

void ParticleSet::Rebase(std::span<const Pose2> path) {
  Particle particle;
  particle.T_map_robot = path.back();
  // The pose keeps some uncertainty, because a closed loop does not make it exact. Half or twice of the two standard
  // deviations changes the errors no more than another seed (study `sensitivity`).
  particle.covariance = PoseCovariance(0.05, 0.01);
  particle.log_likelihood = best().log_likelihood;
  for (const Pose2& pose : path) particle.path.Append(pose);
  std::fill(particles_.begin(), particles_.end(), particle);
  best_ = 0;
  travelled_ = 0.0;
  sample_due_ = false;
  errors_.Rebase(path.size(), path.back(), particle.covariance);
  effective_ = static_cast<double>(particles_.size());
  estimate_ = {particle.T_map_robot, particle.covariance};
}

std::vector<Pose2> ParticleSet::MoveTo(std::span<const Pose2> path) {
  const PosePath before = best().path;
  std::vector<Pose2> T_new_old;
  T_new_old.reserve(path.size());
  // What has not moved keeps its bits.
  for (std::size_t k = 0; k < path.size(); ++k)
    T_new_old.push_back(path[k] == before[k] ? Pose2{} : path[k] * before[k].Inverse());
  RemakePaths(path.size(), SharedByAll(), [&](const PosePath& old, std::size_t k) {
    return old[k] == before[k] ? path[k] : T_new_old[k] * old[k];
  });
  const double turned_rad = T_new_old.back().theta;
  for (Particle& particle : particles_) {
    particle.T_map_robot = particle.path[path.size() - 1];
    particle.covariance = Rotated(particle.covariance, turned_rad);
  }
  errors_.MoveMap(T_new_old);
  estimate_ = {T_new_old.back() * estimate_.T_map_robot, Rotated(estimate_.covariance, turned_rad)};
  return T_new_old;
}

void ParticleSet::Retire(const Retirement& retirement) {
  const std::vector<std::size_t>& kept = retirement.kept;
  const auto apart = static_cast<std::size_t>(std::ranges::lower_bound(kept, SharedByAll()) - kept.begin());
  RemakePaths(kept.size(), apart, [&kept](const PosePath& old, std::size_t i) { return old[kept[i]]; });
  errors_.Retire(retirement);
}

std::size_t ParticleSet::SharedByAll() const {
  std::size_t shared = best().path.size();
  for (const Particle& particle : particles_) shared = particle.path.SharedWith(best().path, shared);
  return shared;
}

template <typename MakePose>
void ParticleSet::RemakePaths(std::size_t size, std::size_t apart, const MakePose& pose) {
  PosePath common;
  for (std::size_t i = 0; i < apart; ++i) common.Append(pose(best().path, i));
  PosePath before, after;  // Of the last particle. Particles that were resampled lately have the same path.
  for (Particle& particle : particles_) {
    const std::size_t old_size = particle.path.size();
    if (before.size() != old_size || particle.path.SharedWith(before, old_size) != old_size) {
      after = common;
      for (std::size_t i = apart; i < size; ++i) after.Append(pose(particle.path, i));
      before = particle.path;
    }
    particle.path = after;
  }
}

// As long as no place has been seen again, all particles are about as likely, and which one is the most likely is
// chance. The mean of those near it would lie as far from the middle of all as a single particle does, and would jump
// whenever another one becomes the most likely. Therefore all particles take part that the stated doubt covers.
void ParticleSet::Summarise(const std::vector<double>& shares) {
  const auto likeliest = std::ranges::max_element(particles_, {}, &Particle::log_likelihood);
  const Eigen::Matrix2d near = kAgreementM * kAgreementM / kMaxNis<2> * Eigen::Matrix2d::Identity();
  // Two poses that are drawn from the same doubt are apart by twice its covariance.
  const Eigen::Matrix2d apart = 2.0 * errors_.covariance(likeliest->T_map_robot).topLeftCorner<2, 2>() + near;
  const auto first = static_cast<std::size_t>(likeliest - particles_.begin());
  const Pose2 centre = particles_[MostLikelyWhereTheWeightIs(first, shares, apart)].T_map_robot;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double sum = 0.0;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    const Eigen::Vector3d d = Minus(particles_[i].T_map_robot, centre);
    if (Nis<2>(d.head<2>(), apart) > kMaxNis<2>) continue;
    mean += shares[i] * d;
    sum += shares[i];
  }
  if (sum > 0.0) mean /= sum;
  estimate_.T_map_robot = Plus(centre, mean);
  best_ = MostLikelyNear(estimate_.T_map_robot);
  const Eigen::Matrix3d covariance = errors_.covariance(estimate_.T_map_robot);
  const Eigen::LDLT<Eigen::Matrix3d> whiten(covariance);
  Eigen::Vector3d spread = Eigen::Vector3d::Zero();
  estimate_.covariance = covariance;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    const Eigen::Vector3d d = Minus(particles_[i].T_map_robot, centre) - mean;
    spread += shares[i] * d.cwiseAbs2();
    if (d.dot(whiten.solve(d)) > kMaxNis<3>) estimate_.covariance += shares[i] * d * d.transpose();
  }
  const Eigen::Vector3d variance = covariance.diagonal().cwiseMax(1e-12);
  spread_share_ = std::min(1.0, spread.cwiseQuotient(variance).mean());
}

// The likelihood of a whole path outlives resampling, and every observation counts for at most kMaxNis in it. So a
// single particle can have the likeliest path while nearly all of the weight is elsewhere.
std::size_t ParticleSet::MostLikelyWhereTheWeightIs(std::size_t likeliest, const std::vector<double>& shares,
                                                    const Eigen::Matrix2d& apart) const {
  const Eigen::Matrix2d information = apart.inverse();
  const auto at_one_place = [&](std::size_t a, std::size_t b) {
    const Eigen::Vector2d d = particles_[a].T_map_robot.translation() - particles_[b].T_map_robot.translation();
    return d.dot(information * d) <= kMaxNis<2>;
  };
  const auto weight_around = [&](std::size_t i) {
    double weight = 0.0;
    for (std::size_t j = 0; j < particles_.size(); ++j) weight += at_one_place(i, j) ? shares[j] : 0.0;
    return weight;
  };
  std::size_t heaviest = likeliest;
  double most = 2.0 * weight_around(likeliest);
  if (most >= 1.0) return likeliest;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    const double weight = weight_around(i);
    if (weight <= most) continue;
    most = weight;
    heaviest = i;
  }
  std::size_t chosen = heaviest;
  for (std::size_t i = 0; i < particles_.size(); ++i)
    if (at_one_place(i, heaviest) && particles_[i].log_likelihood > particles_[chosen].log_likelihood) chosen = i;
  return chosen;
}

// The particle whose path is believed: it has to end where the robot is said to be.
std::size_t ParticleSet::MostLikelyNear(const Pose2& T_map_robot) const {
  std::size_t best = 0;
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    const double distance_m = (particles_[i].T_map_robot.translation() - T_map_robot.translation()).norm();
    const double away_m = std::max(distance_m, kAgreementM);  // All that are near are alike in this.
    const bool likelier = particles_[i].log_likelihood > particles_[best].log_likelihood;
    if (away_m > least_m || (away_m == least_m && !likelier)) continue;
    best = i;
    least_m = away_m;
  }
  return best;
}

void ParticleSet::Draw(std::size_t index, double share) {
  Particle& particle = particles_[index];
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(particle.covariance);
  const Eigen::Vector3d spread = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  const Eigen::Vector3d draw = ThreeNormalDraws(rng_);
  const Eigen::Vector3d step = solver.eigenvectors() * (share * spread).cwiseProduct(draw);
  particle.T_map_robot = Plus(particle.T_map_robot, step);
  particle.covariance.setZero();
}

std::vector<double> ParticleSet::weights() const {
  std::vector<double> log_weights;
  log_weights.reserve(particles_.size());
  for (const Particle& particle : particles_) log_weights.push_back(particle.log_weight);
  return NormalisedWeights(log_weights);
}

std::vector<WeightedPose> ParticleSet::belief() const {
  std::vector<WeightedPose> belief;
  belief.reserve(particles_.size());
  for (const double weight : weights()) belief.push_back({particles_[belief.size()].T_map_robot, weight});
  return belief;
}

// `left` receives the weights of the set after resampling.
std::vector<int> ParticleSet::Resample(std::vector<double>& left) {
  left = weights();
  effective_ = EffectiveSampleSize(left);
  if (effective_ >= options_.resample_below * static_cast<double>(particles_.size())) return {};
  std::vector<int> parents = StratifiedSurvivors(left, rng_);
  particles_ = Resampled(particles_, parents);
  for (Particle& particle : particles_) particle.log_weight = 0.0;
  errors_.Resample(SharedParentFraction(parents));
  left.assign(particles_.size(), 1.0 / static_cast<double>(particles_.size()));
  return parents;
}

FilterHealth ParticleSet::health() const {
  const bool finite = estimate_.T_map_robot.IsFinite() && estimate_.covariance.allFinite();
  return {effective_, nis_.sum(), nis_.numbers(), !finite};
}

}  // namespace cairn::slam
