#include "server/slam/tracking/odometry_learning.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <functional>
#include <string>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

// A comparison: after so much way or turn. Half and twice as much give the same values within their doubt on intel,
// mit-csail and simulated drives; shorter ones have more noise of matching, longer ones are fewer.
constexpr double kCompareAfterM = 1.0, kCompareAfterRad = 1.0;
constexpr double kLongest = 4.0;  // Times these, if no scan matches meanwhile.
// What is known of a robot before it drives, and how fast its parameters walk, per square root of a kilometre.
constexpr std::array<double, OdometryLearning::kCount> kFirstSigma = {0.03, 0.03, 0.02, 0.1};
constexpr std::array<double, OdometryLearning::kCount> kWalkPerSqrtKm = {0.003, 0.003, 0.002, 0.003};
// The noise of a match at either end of a stretch. Errors of the points of a surface are alike, so that they show less
// than so many separate ones.
constexpr double kMatchM = 0.004, kMatchRad = 0.002, kAlikePoints = 4.0;
constexpr double kLeastInformation = 1e-4;  // 1/m^2: an open direction counts nothing.
// The noise of odometry that is assumed at first; noise_ changes it.
constexpr double kPerSqrtM = 0.02, kPerSqrtRad = 0.01, kTurnPerSqrtM = 0.02, kTurnPerSqrtRad = 0.03;
// It follows the median of the squared errors, which wheels that slip now and then hardly change.
constexpr double kNoiseGain = 0.04, kMedianSquare = 0.789, kLeastNoise = 0.05, kMostNoise = 1e4;  // Of chi^2(3) / 3.
constexpr double kCauchySquare = 9.0;
constexpr double kUseFrom = 5.0, kUseUntil = 3.0;  // Standard deviations.
// By Parameter: what is smaller is not used. Scans show turns well, so that small errors of the odometry's turns do no
// harm, while a correction of them does (measured: heading off by 0.27 instead of 0.23 degrees in six drives).
constexpr std::array<double, OdometryLearning::kCount> kWorthUsing = {0.0, 0.015, 0.015, 0.0};
constexpr double kNoLongerWorth = 0.7;  // Of it.
// And only where the lag is known this well, because a lag that is not looks like a turn scale that changes: so in
// mit-csail and mit-killian, whose odometry is sparse and whose scans are late by more than half of the time between
// two of them. Used all the same, the online error on mit-csail was larger for every seed (0.038 to 0.056 instead of
// 0.034 to 0.039 m).
constexpr double kLagKnownS = 0.02;
// And only where the values explain odometry that well: the noise that is left. It is 0.1 to 0.3 for simulated robots,
// and 4.7 on mit-csail.
constexpr double kExplainedFrom = 0.4, kExplainedUntil = 0.8;
constexpr double kChange = 1e-3;
// A change of the lag that is smaller is not worth one.
constexpr double kLagStepS = 0.004;

Eigen::Matrix2d MatchNoise(const Eigen::Matrix2d& information_track, double heading) {
  const Eigen::Matrix2d R = Pose2{0.0, 0.0, heading}.rotation();
  const Eigen::Matrix2d information = R.transpose() * information_track * R / kAlikePoints;
  return (information + kLeastInformation * Eigen::Matrix2d::Identity()).inverse();
}

Pose2 Moved(const Pose2& rate, double seconds) {
  return {rate.x * seconds, rate.y * seconds, WrapAngle(rate.theta * seconds)};
}

WheelCorrection Changed(std::size_t parameter) {
  WheelCorrection wheels;
  if (parameter == OdometryLearning::kWheelScale) wheels.wheel_scale += kChange;
  if (parameter == OdometryLearning::kTurnScale) wheels.turn_scale += kChange;
  if (parameter == OdometryLearning::kTurnPerM) wheels.turn_per_m += kChange;
  return wheels;
}

}  // namespace

void Visit(OptionVisitor& visitor, LearningOptions& options) {
  visitor.Flag("enabled", options.enabled,
               "Whether the errors of the wheels and the lag of the lidar are learned while the robot drives.");
  visitor.Real("largest_scale_error", options.largest_scale_error, "1", 0.0, 0.5,
               "The scales of way and turn are corrected by no more than this; 0: not at all.");
  visitor.Real("largest_turn_per_m", options.largest_turn_per_m, "rad/m", 0.0, 1.0,
               "The turn that odometry does not notice is corrected by no more than this; 0: not at all.");
  visitor.Real("largest_lag_s", options.largest_lag_s, "s", 0.0, 1.0,
               "The lag between scans and odometry is corrected by no more than this; 0: not at all.");
}

OdometryLearning::Matrix OdometryLearning::FirstCovariance() {
  Matrix P = Matrix::Zero();
  for (std::size_t k = 0; k < kCount; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    P(i, i) = kFirstSigma[k] * kFirstSigma[k];
  }
  return P;
}

double OdometryLearning::Bounded(std::size_t parameter) const {
  const std::array<double, kCount> largest = {options_.largest_scale_error, options_.largest_scale_error,
                                              options_.largest_turn_per_m, options_.largest_lag_s};
  return std::clamp(mean_(static_cast<Eigen::Index>(parameter)), -largest[parameter], largest[parameter]);
}

WheelCorrection OdometryLearning::wheels() const {
  const auto used = [this](Parameter parameter) { return used_[parameter] ? Bounded(parameter) : 0.0; };
  return {1.0 + used(kWheelScale), 1.0 + used(kTurnScale), used(kTurnPerM)};
}

Pose2 OdometryLearning::Corrected(const Pose2& T_odom_robot, bool driven, const Pose2& rate) {
  if (!on_) return T_odom_robot;
  if (!driven) Interrupt();
  if (last_) {
    const Pose2 step = Between(*last_, T_odom_robot);
    if (corrected_) corrected_ = *corrected_ * (driven ? wheels().Apply(step) : step);
    if (stretch_) {
      stretch_->reported = stretch_->reported * step;
      for (std::size_t k = 0; k < stretch_->changed.size(); ++k)
        stretch_->changed[k] = stretch_->changed[k] * Changed(k).Apply(step);
      stretch_->way_m += step.translation().norm();
      stretch_->turn_rad += std::abs(step.theta);
    }
  }
  last_ = T_odom_robot;
  rate_ = rate;
  return corrected_.value_or(T_odom_robot);
}

std::vector<Odometry> OdometryLearning::Corrected(const std::vector<Odometry>& during) const {
  std::vector<Odometry> corrected = during;
  const WheelCorrection correction = wheels();
  for (std::size_t i = 1; i < during.size(); ++i)
    corrected[i].T_odom_robot =
        corrected[i - 1].T_odom_robot * correction.Apply(Between(during[i - 1].T_odom_robot, during[i].T_odom_robot));
  return corrected;
}

void OdometryLearning::Learn(const TrackStep& step) {
  if (!on_ || !last_) return;
  if (stretch_ && (stretch_->way_m > kLongest * kCompareAfterM || stretch_->turn_rad > kLongest * kCompareAfterRad))
    Interrupt();
  if (!step.matched || step.found) return;
  if (stretch_) {
    if (stretch_->way_m < kCompareAfterM && stretch_->turn_rad < kCompareAfterRad) return;
    Compare(*stretch_, step);
    const double lag_before = lag_s_;
    ChooseUsed();
    // The next step begins where odometry with the new lag would have been.
    last_ = *last_ * Moved(rate_, lag_before - lag_s_);
  }
  stretch_ = Stretch{.T_track_start = step.T_track_robot, .information = step.surface_information, .rate = rate_};
}

void OdometryLearning::Compare(const Stretch& stretch, const TrackStep& step) {
  const Pose2 matched = Between(stretch.T_track_start, step.T_track_robot);
  // All in the frame of the robot at the end, as odometry has it.
  const auto seen_from_end = [&](const Pose2& other) { return Minus(Between(stretch.reported, other), Pose2{}); };
  Eigen::Matrix<double, 3, kCount> J;
  for (std::size_t k = 0; k < stretch.changed.size(); ++k)
    J.col(static_cast<Eigen::Index>(k)) = seen_from_end(stretch.changed[k]) / kChange;
  // Both ends earlier.
  const Pose2 earlier = Moved(stretch.rate, -kChange).Inverse() * stretch.reported * Moved(rate_, -kChange);
  J.col(kLag) = seen_from_end(earlier) / kChange;

  Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
  R.topLeftCorner<2, 2>() = MatchNoise(stretch.information, step.T_track_robot.theta) +
                            MatchNoise(step.surface_information, step.T_track_robot.theta) +
                            2.0 * kMatchM * kMatchM * Eigen::Matrix2d::Identity();
  R(2, 2) = 2.0 * kMatchRad * kMatchRad;
  const double way = stretch.way_m, turn = stretch.turn_rad;
  const double moved = kPerSqrtM * kPerSqrtM * way + kPerSqrtRad * kPerSqrtRad * turn;
  R.diagonal() +=
      Eigen::Vector3d(moved, moved, kTurnPerSqrtM * kTurnPerSqrtM * way + kTurnPerSqrtRad * kTurnPerSqrtRad * turn);
  R *= noise_;

  for (std::size_t k = 0; k < kCount; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    covariance_(i, i) += kWalkPerSqrtKm[k] * kWalkPerSqrtKm[k] * way / 1000.0;
  }
  Vector beyond = mean_;  // What odometry as it was paired has not been corrected for.
  beyond(kLag) -= lag_s_;
  Eigen::Vector3d error = seen_from_end(matched) - J * beyond;
  error.z() = WrapAngle(error.z());
  const Eigen::Matrix3d HPH = J * covariance_ * J.transpose();
  const double square = error.dot((HPH + R).ldlt().solve(error)) / 3.0;
  if (!std::isfinite(square)) return;
  noise_ = std::clamp(noise_ * (square > kMedianSquare ? 1.0 + kNoiseGain : 1.0 - kNoiseGain), kLeastNoise, kMostNoise);
  const Eigen::Matrix3d S = HPH + R * (1.0 + square / kCauchySquare);
  const Eigen::Matrix<double, kCount, 3> K = S.ldlt().solve(J * covariance_).transpose();
  mean_ += K * error;
  covariance_ -= K * J * covariance_;
  covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();
}

void OdometryLearning::ChooseUsed() {
  const bool any = std::ranges::any_of(used_, std::identity{});
  const bool lag_known = covariance_(kLag, kLag) < kLagKnownS * kLagKnownS;
  const bool explained = lag_known && noise_ < (any ? kExplainedUntil : kExplainedFrom);
  for (std::size_t k = 0; k < kCount; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const double sigmas = std::abs(mean_(i)) / std::sqrt(std::max(covariance_(i, i), 1e-18));
    const double worth = kWorthUsing.at(k) * (used_[k] ? kNoLongerWorth : 1.0);
    used_[k] = explained && std::abs(mean_(i)) >= worth && sigmas > (used_[k] ? kUseUntil : kUseFrom);
  }
  const double lag = used_[kLag] ? Bounded(kLag) : 0.0;
  if (std::abs(lag - lag_s_) > kLagStepS) lag_s_ = lag;
  if (!corrected_ && (wheels() != WheelCorrection{} || lag_s_ != 0.0)) corrected_ = last_;
}

std::vector<LearnedValue> OdometryLearning::values() const {
  if (!on_) return {};
  static constexpr std::array<const char*, kCount> kNames = {"wheel_scale", "turn_scale", "turn_per_m", "laser_lag_s"};
  static constexpr std::array<const char*, kCount> kUnits = {"1", "1", "rad/m", "s"};
  static constexpr std::array<double, kCount> kNone = {1.0, 1.0, 0.0, 0.0};
  std::vector<LearnedValue> values;
  for (std::size_t k = 0; k < kCount; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    values.push_back(
        {kNames[k], kUnits[k], kNone[k] + Bounded(k), std::sqrt(std::max(0.0, covariance_(i, i))), used_[k]});
  }
  return values;
}

}  // namespace cairn::slam
