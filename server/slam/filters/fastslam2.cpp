#include "server/slam/filters/fastslam2.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "server/slam/motion/odometry_model.h"

namespace cairn::slam {
namespace {

// Log density of an innovation, with the squared Mahalanobis distance capped: one contradicting observation may cost a
// particle much, but not everything.
template <int N>
double LogLikelihood(const Eigen::Matrix<double, N, 1>& innovation, const Eigen::Matrix<double, N, N>& S,
                     double max_nis) {
  // Table 4.8 prints the weight upside down: it is e^num / den.
  const double nis = innovation.dot(S.inverse() * innovation);
  return -0.5 * (std::min(nis, max_nis) + std::log(std::max(S.determinant(), 1e-300)) + N * std::log(2.0 * kPi));
}

// Fuses one measurement into the particle's pose (Table 4.6, one line of its loop) in Kalman form.
template <int N>
void Correct(Particle& particle, const Eigen::Matrix<double, N, 1>& innovation,
             const Eigen::Matrix<double, N, 3>& J_z_pose, const Eigen::Matrix<double, N, N>& S) {
  const Eigen::Matrix<double, 3, N> K = particle.covariance * J_z_pose.transpose() * S.inverse();
  const Eigen::Vector3d step = K * innovation;
  Pose2& pose = particle.T_map_robot;
  pose = {pose.x + step.x(), pose.y + step.y(), WrapAngle(pose.theta + step.z())};
  const Eigen::Matrix3d P = (Eigen::Matrix3d::Identity() - K * J_z_pose) * particle.covariance;
  particle.covariance = 0.5 * (P + P.transpose());
}

struct RevisitInnovation {
  Eigen::Vector3d innovation;
  Eigen::Matrix3d J_z_pose;
  Eigen::Matrix3d S;
  [[nodiscard]] double nis() const { return innovation.dot(S.inverse() * innovation); }
};

RevisitInnovation Innovate(const Particle& particle, const RevisitObservation& revisit) {
  const Pose2& T_map_keyframe = particle.path[revisit.keyframe];
  const Pose2 predicted = Between(T_map_keyframe, particle.T_map_robot);
  RevisitInnovation result;
  result.innovation = revisit.T_keyframe_robot.vector() - predicted.vector();
  result.innovation.z() = WrapAngle(result.innovation.z());
  result.J_z_pose = J_compose_right(T_map_keyframe.Inverse(), particle.T_map_robot);
  result.S = result.J_z_pose * particle.covariance * result.J_z_pose.transpose() + revisit.covariance;
  return result;
}

void Update(LandmarkPosition& landmark, const Pose2& T_map_robot, const Eigen::Vector2d& z,
            const Eigen::Matrix2d& R_z) {
  const RangeBearing predicted = PredictRangeBearing(T_map_robot, landmark.mean);
  Eigen::Vector2d innovation = z - predicted.z;
  innovation.y() = WrapAngle(innovation.y());
  // Table 4.7 writes xf for pf in the gain.
  const Eigen::Matrix2d S = predicted.J_z_point * landmark.covariance * predicted.J_z_point.transpose() + R_z;
  const Eigen::Matrix2d K = landmark.covariance * predicted.J_z_point.transpose() * S.inverse();
  landmark.mean += K * innovation;
  const Eigen::Matrix2d P = (Eigen::Matrix2d::Identity() - K * predicted.J_z_point) * landmark.covariance;
  landmark.covariance = 0.5 * (P + P.transpose());
}

LandmarkPosition Initial(const Pose2& T_map_robot, const Eigen::Vector2d& p_robot, const Eigen::Matrix2d& R_z) {
  const Eigen::Vector2d z = MeasureRangeBearing(p_robot);
  const double bearing = T_map_robot.theta + z.y();
  // Gz is the Jacobian with respect to the measurement; (4-15) names the vehicle's states.
  Eigen::Matrix2d Gz;
  Gz << std::cos(bearing), -z.x() * std::sin(bearing), std::sin(bearing), z.x() * std::cos(bearing);
  return {T_map_robot * p_robot, Gz * R_z * Gz.transpose()};
}

}  // namespace

void Visit(OptionVisitor& visitor, FastSlamOptions& options) {
  visitor.Section("drift", "Noise of the matched motion: how far the front-end drifts.",
                  [&] { Visit(visitor, options.drift); });
  visitor.Real("sample_distance_m", options.sample_distance_m, "m", 0.0, 1000.0,
               "Travelled before uncertainty is sampled without an observation.");
  visitor.Real("resample_below", options.resample_below, "1", 0.0, 1.0,
               "Share of particles that still count below which the set is resampled.");
  visitor.Real("max_nis", options.max_nis, "1", 1.0, 1000.0,
               "Squared Mahalanobis distance beyond which an observation adds no more doubt.");
  visitor.Real("agreement_m", options.agreement_m, "m", 0.0, 100.0,
               "Particles this near the best one take part in the reported pose.");
  visitor.Real("landmark_range_m", options.landmark.range_m, "m", 0.001, 5.0, "Noise of a landmark's range.");
  visitor.Real("landmark_bearing_rad", options.landmark.bearing_rad, "rad", 0.0001, 1.0,
               "Noise of a landmark's bearing.");
}

FastSlam2::FastSlam2(const FastSlamOptions& options, const LandmarkOptions& landmarks, std::int64_t particles,
                     const Pose2& T_map_robot_start, std::uint64_t seed)
    : options_(options),
      tracker_(landmarks, options.landmark),
      rng_(seed),
      particles_(static_cast<std::size_t>(particles)) {
  for (Particle& particle : particles_) particle.T_map_robot = T_map_robot_start;
  effective_ = static_cast<double>(particles_.size());
}

void FastSlam2::Predict(const Pose2& T_prev_curr, const Eigen::Matrix3d& covariance_prev) {
  const OdometryControl control = InverseOdometry(T_prev_curr);
  const Eigen::Matrix3d drift = options_.drift.Covariance(T_prev_curr) + covariance_prev;
  for (Particle& particle : particles_) {
    const Eigen::Matrix3d Gv = J_pose_pose(particle.T_map_robot, control);
    // The step's noise is known in the frame it starts from; Gu R_u Gu' with R_u expressed there.
    const Eigen::Matrix3d J_step = J_compose_right(particle.T_map_robot, T_prev_curr);
    particle.covariance = Gv * particle.covariance * Gv.transpose() + J_step * drift * J_step.transpose();
    particle.T_map_robot = ApplyControl(particle.T_map_robot, control);
  }
  travelled_ += T_prev_curr.translation().norm();
}

bool FastSlam2::Observe(const RevisitObservation& revisit) {
  std::vector<RevisitInnovation> innovations;
  innovations.reserve(particles_.size());
  double nearest = std::numeric_limits<double>::infinity();
  for (const Particle& particle : particles_) {
    innovations.push_back(Innovate(particle, revisit));
    nearest = std::min(nearest, innovations.back().nis());
  }
  if (!(nearest < options_.max_nis)) return false;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    const RevisitInnovation& seen = innovations[i];
    const double log_likelihood = LogLikelihood<3>(seen.innovation, seen.S, options_.max_nis);
    particles_[i].log_weight += log_likelihood;
    particles_[i].log_likelihood += log_likelihood;
    if (seen.nis() < options_.max_nis) Correct<3>(particles_[i], seen.innovation, seen.J_z_pose, seen.S);
  }
  sample_due_ = true;
  return true;
}

void FastSlam2::Observe(const KeyframeSight& sight, const ParallelFor& /*parallel_for*/) {
  Observe(tracker_.Observe(sight.view.features, sight.T_track_robot, sight.travelled_m, best()));
}

Hypothesis FastSlam2::hypothesis(std::size_t index) const {
  const Particle& particle = index == 0 ? best() : particles_[index - 1];
  return {particle.T_map_robot, particle.path};
}

std::vector<Landmark> FastSlam2::landmarks() const {
  const std::vector<LandmarkSignature>& signatures = tracker_.signatures();
  std::vector<Landmark> landmarks;
  for (std::size_t id = 0; id < best().landmarks.size(); ++id) {
    const LandmarkEstimate& estimate = best().landmarks[id];
    const Eigen::Vector2d along = estimate.extension.mean - estimate.position.mean;
    landmarks.push_back({id, signatures[id].corner, estimate.position.mean, std::atan2(along.y(), along.x()),
                         estimate.position.covariance, estimate.sightings});
  }
  return landmarks;
}

void FastSlam2::Observe(std::span<const LandmarkObservation> sightings) {
  if (sightings.empty()) return;
  const Eigen::Matrix2d R_z = options_.landmark.R_z();
  for (const LandmarkObservation& sighting : sightings)
    if (!sighting.known) landmark_count_ = std::max(landmark_count_, sighting.id + 1);
  for (Particle& particle : particles_) {
    // Weight and proposal from everything known, position by position (Tables 4.5, 4.6, 4.8).
    for (const LandmarkObservation& sighting : sightings) {
      if (!sighting.known) continue;
      const LandmarkEstimate& landmark = particle.landmarks[sighting.id];
      const auto fuse = [&](const LandmarkPosition& position, const Eigen::Vector2d& p_robot) {
        const RangeBearing predicted = PredictRangeBearing(particle.T_map_robot, position.mean);
        Eigen::Vector2d innovation = MeasureRangeBearing(p_robot) - predicted.z;
        innovation.y() = WrapAngle(innovation.y());
        const Eigen::Matrix2d S = predicted.J_z_pose * particle.covariance * predicted.J_z_pose.transpose() +
                                  predicted.J_z_point * position.covariance * predicted.J_z_point.transpose() + R_z;
        const double log_likelihood = LogLikelihood<2>(innovation, S, options_.max_nis);
        particle.log_weight += log_likelihood;
        particle.log_likelihood += log_likelihood;
        if (innovation.dot(S.inverse() * innovation) < options_.max_nis)
          Correct<2>(particle, innovation, predicted.J_z_pose, S);
      };
      fuse(landmark.position, sighting.p_robot);
      fuse(landmark.extension, sighting.extension_robot());
    }
    Sample(particle);
    for (const LandmarkObservation& sighting : sightings) {
      if (sighting.known) {
        LandmarkEstimate& landmark = particle.landmarks.Mutable(sighting.id);
        Update(landmark.position, particle.T_map_robot, MeasureRangeBearing(sighting.p_robot), R_z);
        Update(landmark.extension, particle.T_map_robot, MeasureRangeBearing(sighting.extension_robot()), R_z);
        ++landmark.sightings;
      } else {
        particle.landmarks.Append({Initial(particle.T_map_robot, sighting.p_robot, R_z),
                                   Initial(particle.T_map_robot, sighting.extension_robot(), R_z), 1,
                                   static_cast<std::uint32_t>(particle.path.size())});
      }
    }
  }
  travelled_ = 0.0;
}

void FastSlam2::Commit() {
  if (sample_due_ || travelled_ >= options_.sample_distance_m) {
    for (Particle& particle : particles_) Sample(particle);
    travelled_ = 0.0;
    sample_due_ = false;
  }
  for (Particle& particle : particles_) particle.path.Append(particle.T_map_robot);
  Summarise(Resample());
}

bool FastSlam2::Rebase(std::span<const Pose2> path) {
  // What the particles disagreed about is decided: they go on from one path and one map, that of the best.
  Particle moved = best();
  for (std::size_t id = 0; id < moved.landmarks.size(); ++id) {
    LandmarkEstimate& landmark = moved.landmarks.Mutable(id);
    const Pose2 correction = path[landmark.first_keyframe] * moved.path[landmark.first_keyframe].Inverse();
    const Eigen::Matrix2d R = correction.rotation();
    for (LandmarkPosition* position : {&landmark.position, &landmark.extension}) {
      position->mean = correction * position->mean;
      position->covariance = R * position->covariance * R.transpose();
    }
  }
  moved.path = {};
  for (const Pose2& pose : path) moved.path.Append(pose);
  moved.T_map_robot = path.back();
  moved.covariance.setZero();
  moved.log_weight = 0.0;
  std::fill(particles_.begin(), particles_.end(), moved);
  best_ = 0;
  effective_ = static_cast<double>(particles_.size());
  estimate_ = {moved.T_map_robot, moved.covariance};
  travelled_ = 0.0;
  sample_due_ = false;
  return true;
}

void FastSlam2::Summarise(const std::vector<double>& weights) {
  best_ = 0;
  for (std::size_t i = 1; i < particles_.size(); ++i)
    if (particles_[i].log_likelihood > particles_[best_].log_likelihood) best_ = i;
  const Pose2& centre = best().T_map_robot;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  double sum = 0.0;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    Eigen::Vector3d d = particles_[i].T_map_robot.vector() - centre.vector();
    d.z() = WrapAngle(d.z());
    if (d.head<2>().norm() > options_.agreement_m) continue;
    first += weights[i] * d;
    second += weights[i] * d * d.transpose();
    sum += weights[i];
  }
  estimate_ = {centre, best().covariance};
  if (!(sum > 0.0)) return;
  const Eigen::Vector3d mean = first / sum;
  estimate_.T_map_robot = {centre.x + mean.x(), centre.y + mean.y(), WrapAngle(centre.theta + mean.z())};
  estimate_.covariance += second / sum - mean * mean.transpose();
}

// Draws the pose from N(xv, pv) and starts collecting uncertainty anew.
void FastSlam2::Sample(Particle& particle) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(particle.covariance);
  const Eigen::Vector3d spread = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  const Eigen::Vector3d draw(NormalDraw(rng_), NormalDraw(rng_), NormalDraw(rng_));
  const Eigen::Vector3d step = solver.eigenvectors() * spread.cwiseProduct(draw);
  Pose2& pose = particle.T_map_robot;
  pose = {pose.x + step.x(), pose.y + step.y(), WrapAngle(pose.theta + step.z())};
  particle.covariance.setZero();
}

// The weights of the set it leaves behind.
std::vector<double> FastSlam2::Resample() {
  std::vector<double> log_weights;
  log_weights.reserve(particles_.size());
  for (const Particle& particle : particles_) log_weights.push_back(particle.log_weight);
  const std::vector<double> weights = NormalisedWeights(log_weights);
  effective_ = EffectiveSampleSize(weights);
  if (effective_ >= options_.resample_below * static_cast<double>(particles_.size())) return weights;
  std::vector<Particle> survivors;
  survivors.reserve(particles_.size());
  for (const int parent : StratifiedSurvivors(weights, rng_)) {
    survivors.push_back(particles_[static_cast<std::size_t>(parent)]);
    survivors.back().log_weight = 0.0;
  }
  particles_ = std::move(survivors);
  return std::vector<double>(particles_.size(), 1.0 / static_cast<double>(particles_.size()));
}

}  // namespace cairn::slam
