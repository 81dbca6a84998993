#include "server/slam/tracking/front_end.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/geometry/pose_difference.h"
#include "common/geometry/rotated_covariance.h"
#include "common/geometry/transform2.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/tracking/odometry_check.h"

namespace cairn::slam {
namespace {

// Odometry is also tried from this many scans back. Where it froze and then caught up, or came late, the step
// since the last scan is wrong although the motion over several scans is right. With half as many scans or twice as
// many, the error on mit-csail changes no more than with another seed (tests/studies/sensitivity).
constexpr std::array<std::size_t, 3> kLookBack = {3, 6, 12};
constexpr int kTurns = 4;  // Turns to either side that are tried.
// An unusual guess must explain this share of the scan more than the best one so far. With half or twice
// the value, the error on mit-csail changes no more than with another seed (tests/studies/sensitivity).
constexpr double kClearly = 0.05;

// Distance between an answer and the odometry in standard deviations.
double JumpOf(const Pose2& T_track_robot, const Pose2& guess, const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d jump = Minus(T_track_robot, guess);
  return std::sqrt(std::max(0.0, jump.dot(covariance.ldlt().solve(jump))));
}

// Transforms points from frame b to frame a and appends them.
void AppendMoved(const Pose2& T_a_b, const std::vector<SurfacePoint>& points_b, std::vector<SurfacePoint>& points_a) {
  const Eigen::Matrix2d R = T_a_b.rotation();
  const Transform2 to_a(T_a_b);
  points_a.reserve(points_a.size() + points_b.size());
  for (const SurfacePoint& point : points_b) points_a.push_back({to_a * point.p, R * point.normal});
}

}  // namespace

FrontEnd::FrontEnd(const FrontEndOptions& options, ScanMatcher matcher, const OdometryNoise& walk)
    : options_(options), matcher_(std::move(matcher)), walk_(walk) {}

ScanView Look(const Scan& scan, const FrontEndOptions& options) {
  const std::vector<BeamPoint> points = PointsOf(scan);
  return {ExtractFeatures(points, scan, options.features), SurfacePointsOf(points, scan, options.surface)};
}

TrackStep FrontEnd::Track(const ScanView& view, const Pose2& T_odom_robot, const ParallelFor& parallel_for) {
  TrackStep step{.T_track_robot = {}, .score = 1.0, .matched = true};
  if (history_.empty()) {
    standstill_.Begin(step.T_track_robot, T_odom_robot);
  } else {
    const MatchResult match = Follow(view, T_odom_robot, parallel_for);
    step = StepOf(match, T_odom_robot);
    if (options_.use_odometry) step.T_track_held = standstill_.Take(T_odom_robot, match);
  }
  score_ = step.score;
  if (options_.use_odometry && !history_.empty()) {
    const double way_m = Between(history_.back().T_odom_robot, T_odom_robot).translation().norm();
    unmatched_m_ = std::max(0.0, unmatched_m_ + (step.matched ? -way_m : way_m));
  }
  history_.push_back({step.T_track_robot, T_odom_robot});
  if (history_.size() > kLookBack.back()) history_.pop_front();
  return step;
}

MatchResult FrontEnd::Follow(const ScanView& view, const Pose2& T_odom_robot, const ParallelFor& parallel_for) const {
  const Guess guess = Predict(T_odom_robot);
  Begin(watch_, ScanStep::kMatch);
  MatchResult coarse = MatchLastKeyframe(view, guess, parallel_for);
  // Along a corridor the alignment moves the points only slowly. If they show nothing in that direction, the
  // refinement must therefore begin at the pose where it is to stay.
  if (!options_.use_odometry && options_.refine_enabled)
    TakeAlongFromPrior({guess.T_track_robot, guess.covariance}, coarse);
  Begin(watch_, ScanStep::kRefine);
  return options_.refine_enabled ? Checked(view, T_odom_robot, guess, Refine(view, T_odom_robot, guess, coarse))
                                 : MatchAlone(view, T_odom_robot, guess, coarse, parallel_for);
}

TrackStep FrontEnd::StepOf(const MatchResult& match, const Pose2& T_odom_robot) const {
  TrackStep step{.T_track_robot = match.T_ref_curr,
                 .score = match.score,
                 .matched = match.converged,
                 .degenerate = match.degenerate};
  if (match.degenerate) {
    step.open_direction = match.degenerate_direction;
    step.open_information = match.open_information;
  }
  if (match.converged) {
    const Eigen::Matrix2d shown = Eigen::Matrix2d::Identity() - step.open_direction * step.open_direction.transpose();
    step.surface_information = shown * match.surface_information * shown;
  }
  step.moved_m = Between(history_.back().T_track_robot, step.T_track_robot).translation().norm();
  if (options_.use_odometry) {
    step.T_prev_curr_odom = Between(history_.back().T_odom_robot, T_odom_robot);
  } else {
    if (!step.matched) step.moved_m = std::max(step.moved_m, options_.no_odometry.unmatched_step_m);
    step.forecast_covariance = ForecastShare(match);
  }
  return step;
}

std::optional<Pose2> FrontEnd::LastOdometryStep() const {
  if (history_.size() < 2) return std::nullopt;
  return Between(history_[history_.size() - 2].T_odom_robot, history_.back().T_odom_robot);
}

std::optional<Pose2> FrontEnd::LastStep() const {
  if (history_.size() < 2) return std::nullopt;
  return Between(history_[history_.size() - 2].T_track_robot, history_.back().T_track_robot);
}

std::optional<TrackStep> FrontEnd::TrackAgain(const ScanView& view, const Pose2& T_odom_robot, const TrackStep& step) {
  if (history_.size() < 2 || !options_.refine_enabled) return std::nullopt;
  const Sight first = history_.back();
  history_.pop_back();
  const Guess guess = Predict(T_odom_robot);
  Begin(watch_, ScanStep::kRefine);
  const MatchResult match = Align(view, step.T_track_robot, guess);
  const bool better = match.converged && match.score > step.score;
  TrackStep again = better ? StepOf(match, T_odom_robot) : step;
  again.T_track_held = step.T_track_held;
  score_ = again.score;
  history_.push_back({again.T_track_robot, first.T_odom_robot});
  if (!better) return std::nullopt;
  return again;
}

FrontEnd::Guess FrontEnd::Predict(const Pose2& T_odom_robot) const {
  const Sight& last = history_.back();
  if (options_.use_odometry) {
    const Pose2 motion = Between(last.T_odom_robot, T_odom_robot);
    const Eigen::Matrix3d J = J_compose_right(last.T_track_robot, motion);
    return {last.T_track_robot * motion, J * options_.odometry.Covariance(motion) * J.transpose()};
  }
  const NoOdometryOptions& expected = options_.no_odometry;
  Pose2 motion;
  if (expected.constant_velocity && history_.size() > 1)
    motion = Between(history_[history_.size() - 2].T_track_robot, last.T_track_robot);
  return {last.T_track_robot * motion, PoseCovariance(expected.sigma_m, expected.sigma_rad)};
}

Eigen::Matrix3d FrontEnd::ForecastShare(const MatchResult& match) const {
  if (match.converged && !match.degenerate) return Eigen::Matrix3d::Zero();
  Eigen::Matrix3d unseen = match.covariance;
  if (match.converged) {
    const Eigen::Vector2d u = match.degenerate_direction;
    const double along = u.dot(unseen.topLeftCorner<2, 2>() * u);
    unseen.setZero();
    unseen.topLeftCorner<2, 2>() = along * u * u.transpose();
  }
  return unseen;
}

// The result is in `track`; the matcher itself works in the keyframe's frame.
MatchResult FrontEnd::MatchLastKeyframe(const ScanView& view, const Guess& guess,
                                        const ParallelFor& parallel_for) const {
  const Pose2& T_track_keyframe = keyframe_.T_track_robot;
  const MatchPrior prior{Between(T_track_keyframe, guess.T_track_robot),
                         Rotated(guess.covariance, -T_track_keyframe.theta)};
  MatchResult match = matcher_.match(keyframe_view_, view, prior, parallel_for);
  match.T_ref_curr = T_track_keyframe * match.T_ref_curr;
  match.covariance = Rotated(match.covariance, T_track_keyframe.theta);
  match.degenerate_direction = T_track_keyframe.rotation() * match.degenerate_direction;
  return match;
}

MatchResult FrontEnd::MatchAlone(const ScanView& view, const Pose2& T_odom_robot, const Guess& guess,
                                 const MatchResult& coarse, const ParallelFor& parallel_for) const {
  MatchResult best = coarse;
  // Only odometry can reveal a fault of the match; a forecast is too uncertain for that.
  if (options_.use_odometry && best.converged &&
      JumpOf(best.T_ref_curr, guess.T_track_robot, guess.covariance) > options_.max_jump_sigma) {
    best.converged = false;
    best.failure = MatchFailure::kFault;
  }
  // Not every matcher keeps to the prior along a corridor.
  if (options_.use_odometry) TakeAlongFromPrior({guess.T_track_robot, guess.covariance}, best);
  double explained = Explained(view, best.converged ? best.T_ref_curr : guess.T_track_robot);
  const auto enough = [&] { return best.converged && explained >= options_.retry_below; };
  const auto consider = [&](const Pose2& other) {
    const MatchResult match = MatchLastKeyframe(
        view, {other, PoseCovariance(options_.retry.sigma_m, options_.retry.sigma_rad)}, parallel_for);
    if (!match.converged) return;
    const double share = Explained(view, match.T_ref_curr);
    if (share <= explained + kClearly) return;
    best = match;
    explained = share;
  };
  const bool retry = !matcher_.searches_wide;
  if (retry && !enough())
    for (const Pose2& other : UnusualGuesses(T_odom_robot)) consider(other);
  for (int k = 1; retry && k <= kTurns && !enough(); ++k) {
    consider(guess.T_track_robot * Pose2{0, 0, k * options_.retry.turn_step_rad});
    consider(guess.T_track_robot * Pose2{0, 0, -k * options_.retry.turn_step_rad});
  }
  best.score = explained;
  if (best.converged && explained >= options_.refine.min_score) return best;
  if (best.converged) best.failure = MatchFailure::kInconsistent;
  best.converged = false;
  best.degenerate = false;
  best.T_ref_curr = guess.T_track_robot;
  best.covariance = guess.covariance;
  return best;
}

double FrontEnd::Explained(const ScanView& view, const Pose2& T_track_robot) const {
  return CompareSurfaces(view.points_robot, keyframe_index_, Between(keyframe_.T_track_robot, T_track_robot),
                         options_.refine.inlier_distance_m)
      .score;
}

// The prior of the alignment is generous, because real odometry fails. Along a corridor rough points and the ends of
// the view, which move with the robot, would outweigh it and hold the robot back.
MatchResult FrontEnd::Align(const ScanView& view, const Pose2& start, const Guess& guess) const {
  MatchResult match =
      AlignPointsToSurfaces(view.points_robot, index_, {start, guess.T_track_robot, guess.covariance}, options_.refine);
  // After scans without a match it may correct what odometry did wrong on that way.
  if (options_.use_odometry && unmatched_m_ <= 0.0) {
    const Pose2 motion = Between(history_.back().T_track_robot, guess.T_track_robot);
    WeighAlongWithPrior({guess.T_track_robot, walk_.Covariance(motion)}, match);
  }
  return match;
}

std::vector<Pose2> FrontEnd::UnusualGuesses(const Pose2& T_odom_robot) const {
  std::vector<Pose2> guesses = {history_.back().T_track_robot};
  for (const std::size_t back : kLookBack) {
    if (!options_.use_odometry || history_.size() < back) continue;
    const Sight& sight = history_[history_.size() - back];
    guesses.push_back(sight.T_track_robot * Between(sight.T_odom_robot, T_odom_robot));
  }
  return guesses;
}

MatchResult FrontEnd::Refine(const ScanView& view, const Pose2& T_odom_robot, const Guess& guess,
                             const MatchResult& coarse) const {
  const auto align = [&](const Pose2& start) { return Align(view, start, guess); };

  // The refinement starts at the matcher's answer or, if there is none, at the prediction.
  MatchResult best = align(coarse.converged ? coarse.T_ref_curr : guess.T_track_robot);
  if (best.converged && best.score >= options_.retry_below) return best;
  if (coarse.converged) {
    const MatchResult match = align(guess.T_track_robot);
    if (match.converged && (!best.converged || match.score > best.score)) best = match;
    if (best.converged && best.score >= options_.retry_below) return best;
  }

  // An unusual guess is taken only if it explains clearly more of the scan.
  const auto consider = [&](const Pose2& other) {
    const MatchResult match = AlignPointsToSurfaces(
        view.points_robot, index_, {other, other, PoseCovariance(options_.retry.sigma_m, options_.retry.sigma_rad)},
        options_.refine);
    if (match.converged && (!best.converged || match.score > best.score + kClearly)) best = match;
  };
  for (const Pose2& other : UnusualGuesses(T_odom_robot)) consider(other);
  for (int k = 1; k <= kTurns; ++k) {
    if (best.converged && best.score >= options_.retry_below) break;
    consider(guess.T_track_robot * Pose2{0, 0, k * options_.retry.turn_step_rad});
    consider(guess.T_track_robot * Pose2{0, 0, -k * options_.retry.turn_step_rad});
  }
  return best;
}

MatchResult FrontEnd::Checked(const ScanView& view, const Pose2& T_odom_robot, const Guess& guess,
                              const MatchResult& match) const {
  if (!options_.use_odometry || !match.converged) return match;
  if (unmatched_m_ > 0.0) return match;  // It may correct what odometry did wrong on that way.
  // The newest scan from which the robot has moved far enough.
  const auto from = std::find_if(history_.rbegin(), history_.rend(), [&](const Sight& sight) {
    return Between(sight.T_odom_robot, T_odom_robot).translation().norm() >= kShortestCheckedStepM;
  });
  if (from == history_.rend()) return match;
  const CheckedStep step{from->T_track_robot, Between(from->T_odom_robot, T_odom_robot), guess.covariance};
  return CheckAgainstOdometry(view.points_robot, index_, step, match, options_.refine);
}

void FrontEnd::AddKeyframe(const ScanView& view) {
  const bool matcher_alone = !options_.refine_enabled && !reference_.empty();
  if (matcher_alone && matcher_.keeps_reference && score_ >= options_.keep_above) return;
  keyframe_ = history_.back();
  AppendMoved(keyframe_.T_track_robot, view.points_robot, reference_.emplace_back());
  for (const SurfacePoint& point : reference_.back()) index_.Add(point);
  if (reference_.size() > static_cast<std::size_t>(options_.reference_keyframes)) {
    index_.DropOldest(reference_.front().size());
    reference_.pop_front();
  }

  keyframe_view_ = view;
  if (!options_.use_odometry)
    keyframe_view_.points_robot = MergedPoints(static_cast<std::size_t>(options_.no_odometry.merged_keyframes));
  BuildKeyframeIndex();
}

void FrontEnd::Restart() {
  score_ = 0.0;
  unmatched_m_ = 0.0;
  standstill_.Restart();
  keyframe_ = {};
  keyframe_view_ = {};
  history_.clear();
  reference_.clear();
  BuildIndices();
}

void FrontEnd::MoveTo(const Pose2& T_new_old) {
  keyframe_.T_track_robot = T_new_old * keyframe_.T_track_robot;
  standstill_.MoveTo(T_new_old);
  for (Sight& sight : history_) sight.T_track_robot = T_new_old * sight.T_track_robot;
  for (auto& points : reference_) {
    const std::vector<SurfacePoint> points_old = std::exchange(points, {});
    AppendMoved(T_new_old, points_old, points);
  }
  BuildIndices();
}

void FrontEnd::BuildIndices() {
  index_.Clear();
  for (const auto& points : reference_)
    for (const SurfacePoint& point : points) index_.Add(point);
  BuildKeyframeIndex();
}

void FrontEnd::BuildKeyframeIndex() {
  keyframe_index_.Clear();
  if (options_.refine_enabled) return;  // Only a matcher that works alone is judged by it.
  for (const SurfacePoint& point : keyframe_view_.points_robot) keyframe_index_.Add(point);
}

std::vector<SurfacePoint> FrontEnd::MergedPoints(std::size_t keyframes) const {
  const Pose2 T_keyframe_track = keyframe_.T_track_robot.Inverse();
  std::vector<SurfacePoint> merged;
  for (std::size_t k = reference_.size() - std::min(keyframes, reference_.size()); k < reference_.size(); ++k)
    AppendMoved(T_keyframe_track, reference_[k], merged);
  return merged;
}

}  // namespace cairn::slam
