#include "server/slam/tracking/standstill.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

// Odometry that has moved less than this since the robot stopped has not moved: a few counts of cheap encoders.
constexpr double kStandsM = 0.001, kStandsRad = 0.002;
// So many matches count for the mean at most, so that it can follow what changes slowly.
constexpr double kMostMatches = 1000.0;
// Share of the newest innovation in their moving average, whose variance is then this share of theirs.
constexpr double kShare = 1.0 / 3.0, kVarianceShare = kShare / (2.0 - kShare);
// So many standard deviations are beyond what a robot that stands shows in a day, also with tails that are a little
// heavier than those of the normal distribution.
constexpr double kMovedSigmas = 7.0;
// A single match that is farther off counts at once: somebody carries the robot. One that is nearer may be a match at a
// wrong place, as a cheap lidar has one in some ten thousand; two that agree are needed.
constexpr double kFarM = 0.1, kFarRad = 0.05;
// How fast the noise is learned, and how much larger than told it can be, as variances. Points of one surface share
// errors of its direction, which no scan shows by itself.
constexpr double kLearningShare = 0.01, kMostTold = 4.0;
// The alignment stops where its steps are shorter than that.
constexpr double kLeastM = 5e-4, kLeastRad = 2e-4;

// Mean of the squares of the normalised numbers: 1 if the covariance is right.
double MeanSquare(const Eigen::Vector3d& difference, const Eigen::Matrix3d& covariance) {
  return difference.dot(covariance.ldlt().solve(difference)) / 3.0;
}

bool IsFar(const Eigen::Vector3d& innovation) {
  return innovation.head<2>().norm() > kFarM || std::abs(innovation.z()) > kFarRad;
}

}  // namespace

void Standstill::Begin(const Pose2& T_track_robot, const Pose2& T_odom_robot) {
  *this = {};
  matches_ = 1.0;
  at_start_ = true;
  T_odom_begin_ = T_odom_robot;
  begin_ = mean_ = T_track_robot;
}

std::optional<Pose2> Standstill::Take(const Pose2& T_odom_robot, const MatchResult& match) {
  const Pose2 moved = Between(T_odom_begin_, T_odom_robot);
  const bool stands = matches_ > 0.0 && moved.translation().norm() < kStandsM && std::abs(moved.theta) < kStandsRad;
  const bool known = match.converged && !match.shown_covariance.isZero(0.0);
  if (stands && !match.converged) return at_start_ ? begin_ : mean_;  // The scan says nothing.
  Eigen::Matrix3d noise = match.shown_covariance;
  noise.diagonal() += Eigen::Vector3d(kLeastM * kLeastM, kLeastM * kLeastM, kLeastRad * kLeastRad);
  const Eigen::Vector3d innovation = Minus(match.T_ref_curr, mean_);
  const Verdict verdict = stands && known ? Judge(innovation, noise) : Verdict::kMoved;
  if (verdict == Verdict::kMoved) {
    at_start_ = false;
    recent_.setZero();
    T_odom_begin_ = T_odom_robot;
    mean_ = match.T_ref_curr;
    matches_ = known ? 1.0 : 0.0;
    return std::nullopt;
  }
  if (verdict == Verdict::kStands) {
    matches_ = std::min(matches_ + 1.0, kMostMatches);
    mean_ = Plus(mean_, innovation / matches_);
  }
  return at_start_ ? begin_ : mean_;
}

Standstill::Verdict Standstill::Judge(const Eigen::Vector3d& innovation, const Eigen::Matrix3d& noise) {
  const double newest = MeanSquare(innovation, (1.0 + 1.0 / matches_) * noise);
  const double limit = kMovedSigmas * kMovedSigmas / 3.0 * noise_;
  if (newest > limit && IsFar(innovation)) return Verdict::kMoved;
  recent_ += kShare * (std::min(1.0, std::sqrt(limit / newest)) * innovation - recent_);
  if (MeanSquare(recent_, (kVarianceShare + 1.0 / matches_) * noise) > limit) return Verdict::kMoved;
  if (newest > limit) return Verdict::kDoubtful;
  noise_ = std::clamp(noise_ + kLearningShare * (newest - noise_), 1.0, kMostTold);
  return Verdict::kStands;
}

void Standstill::MoveTo(const Pose2& T_new_old) {
  begin_ = T_new_old * begin_;
  mean_ = T_new_old * mean_;
  recent_.head<2>() = (T_new_old.rotation() * recent_.head<2>()).eval();
}

}  // namespace cairn::slam
