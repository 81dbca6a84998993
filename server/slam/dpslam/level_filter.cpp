#include "server/slam/dpslam/level_filter.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

// Only particles this near to the best one take part in the reported pose, so that other hypotheses do not
// distort it.
constexpr double kAgreementM = 0.5;

bool ShowsRays(const Evidence& evidence) {
  return std::any_of(evidence.begin(), evidence.end(),
                     [](const PlacedRays& placed) { return !placed.rays->rays.empty(); });
}

}  // namespace

void Visit(OptionVisitor& visitor, LevelOptions& options) {
  visitor.Real("sigma_m", options.sigma_m, "m", 0.005, 1.0,
               "Standard deviation of a range against the map. With a larger value more particles agree with a scan.");
  visitor.Real("evidence_share", options.evidence_share, "1", 0.001, 1.0,
               "Share of the log likelihood of a ray that counts, because neighbouring rays have similar errors. 1 "
               "treats all rays as independent.");
  visitor.Real("outlier_share", options.outlier_share, "1", 0.0001, 0.99,
               "Share of the rays that end on something that is not in the map, such as people.");
  visitor.Real("resample_below", options.resample_below, "1", 0.0, 1.0,
               "The particles are resampled when the effective sample size falls below this share of their number. 1 "
               "resamples after every step.");
  visitor.Integer("ray_stride", options.ray_stride, "1", 1, 1000,
                  "Only every n-th ray is used for the weights of the particles. All rays are drawn into the maps.");
  visitor.Real("give_up_behind", options.give_up_behind, "1", 0.0, 1000.0,
               "A particle is given up when its weighted log likelihood is this far below the best after a quarter of "
               "the rays. 0 keeps all.");
  visitor.Section("drift", "Uncertainty of a motion.", [&] { Visit(visitor, options.drift); });
}

LevelFilter::LevelFilter(const LevelOptions& options, const OpacityOptions& opacity, const Pose2& T_map_robot_start)
    : options_(options),
      maps_(opacity),
      particles_(static_cast<std::size_t>(options.particles)),
      mean_(T_map_robot_start),
      effective_(static_cast<double>(options.particles)) {
  for (GridParticle& particle : particles_) particle.T_map_robot = T_map_robot_start;
}

void LevelFilter::Move(const std::function<Pose2()>& draw_step, const Pose2& T_mean,
                       const Eigen::Matrix3d& covariance_prev, Rng& rng) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance_prev);
  const Eigen::Matrix3d root = solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  for (GridParticle& particle : particles_) {
    const Eigen::Vector3d draw = ThreeNormalDraws(rng);
    const Eigen::Vector3d step = draw_step().vector() + root * draw;
    particle.T_map_robot = particle.T_map_robot * Pose2{step.x(), step.y(), WrapAngle(step.z())};
  }
  mean_ = mean_ * T_mean;
}

void LevelFilter::Observe(const Evidence& evidence, Rng& rng, const ParallelFor& parallel_for) {
  std::vector<MapSample> samples;
  samples.reserve(particles_.size());
  for (const GridParticle& particle : particles_) samples.push_back({particle.T_map_robot, particle.map, 0});
  const bool sees = ShowsRays(evidence);
  gain_ = 0.0;
  if (sees && !maps_.blank()) {
    const std::vector<double> log_likelihoods = LogLikelihoods(samples, {&evidence, 1}, parallel_for);
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      particles_[i].log_weight += options_.evidence_share * log_likelihoods[i];
      particles_[i].log_likelihood += options_.evidence_share * log_likelihoods[i];
    }
    gain_ = GainOf(evidence, *std::max_element(log_likelihoods.begin(), log_likelihoods.end()));
  }
  for (std::size_t i = 0; i < particles_.size(); ++i)
    for (const PlacedRays& placed : evidence)
      particles_[i].path.Append(particles_[i].T_map_robot = samples[i].T_map_start * placed.T_start_robot);
  const std::vector<double> weights = Summarise();
  if (!sees) return;

  if (effective_ <= options_.resample_below * static_cast<double>(particles_.size())) {
    const std::vector<int> parents = StratifiedSurvivors(weights, rng);
    particles_ = Resampled(particles_, parents);
    samples = Resampled(samples, parents);
    best_ = 0;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      particles_[i].log_weight = 0.0;
      if (particles_[i].log_posterior() > particles_[best_].log_posterior()) best_ = i;
    }
  }
  const Drawings drawings = Distinct(samples);
  Adopt(drawings, maps_.Draw(drawings.distinct, {&evidence, 1}, parallel_for));
}

RayModel LevelFilter::Model() const {
  const OpacityOptions& opacity = maps_.options();
  return {options_.sigma_m, options_.outlier_share, opacity.max_ray_m, opacity.resolution_m, options_.unseen_per_m};
}

std::vector<double> LevelFilter::LogLikelihoods(std::span<const MapSample> samples,
                                                std::span<const Evidence> alternatives,
                                                const ParallelFor& parallel_for) const {
  return maps_.LogLikelihoods(
      samples, alternatives,
      {Model(), static_cast<std::size_t>(options_.ray_stride), options_.give_up_behind / options_.evidence_share},
      parallel_for);
}

double LevelFilter::GainOf(const Evidence& evidence, double log_likelihood) const {
  const auto stride = static_cast<std::size_t>(options_.ray_stride);
  std::size_t rays = 0;
  for (const PlacedRays& placed : evidence) {
    log_likelihood -= UnseenLogLikelihood(*placed.rays, stride, Model());
    rays += (placed.rays->rays.size() + stride - 1) / stride;
  }
  return log_likelihood / static_cast<double>(std::max<std::size_t>(rays, 1));
}

LevelFilter::Drawings LevelFilter::Distinct(std::span<const MapSample> samples) {
  Drawings drawings;
  drawings.of_particle.reserve(samples.size());
  for (const MapSample& sample : samples) {
    if (drawings.distinct.empty() || !(drawings.distinct.back() == sample)) drawings.distinct.push_back(sample);
    drawings.of_particle.push_back(drawings.distinct.size() - 1);
  }
  return drawings;
}

void LevelFilter::Replace(std::vector<GridParticle> particles) {
  particles_ = std::move(particles);
  (void)Summarise();
}

void LevelFilter::Adopt(const Drawings& drawings, std::vector<Ancestry::Child> children) {
  maps_.NextGeneration(std::move(children));
  for (std::size_t i = 0; i < particles_.size(); ++i) particles_[i].map = drawings.of_particle[i];
}

std::vector<double> LevelFilter::weights() const {
  std::vector<double> log_weights;
  log_weights.reserve(particles_.size());
  for (const GridParticle& particle : particles_) log_weights.push_back(particle.log_weight);
  return NormalisedWeights(log_weights);
}

std::vector<double> LevelFilter::Summarise() {
  std::vector<double> weights = this->weights();
  effective_ = EffectiveSampleSize(weights);
  best_ = 0;
  for (std::size_t i = 1; i < particles_.size(); ++i)
    if (particles_[i].log_posterior() > particles_[best_].log_posterior()) best_ = i;
  const Pose2& centre = best().T_map_robot;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  double sum = 0.0;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    const Eigen::Vector3d d = Minus(particles_[i].T_map_robot, centre);
    if (weights[i] <= 0.0 || d.head<2>().norm() > kAgreementM) continue;
    first += weights[i] * d;
    second += weights[i] * d * d.transpose();
    sum += weights[i];
  }
  mean_ = centre;
  covariance_.setZero();
  if (!(sum > 0.0)) return weights;
  const Eigen::Vector3d shift = first / sum;
  mean_ = Plus(centre, shift);
  covariance_ = second / sum - shift * shift.transpose();
  return weights;
}

}  // namespace cairn::slam
