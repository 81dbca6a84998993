#include "server/slam/front_end.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "server/slam/matching/degeneracy.h"
#include "server/slam/matching/surface_agreement.h"

namespace cairn::slam {
namespace {

// Scans back from which odometry is also tried: where it froze and then caught up, or came late, the step since the
// last scan is wrong although the way over several is right.
constexpr std::array<std::size_t, 3> kLookBack = {3, 6, 12};
constexpr std::size_t kHistory = 16;

// Turns tried about the guess, either way, while nothing explains the scan: odometry that froze in a turn.
constexpr std::array<double, 4> kTurns = {0.25, 0.5, 0.75, 1.0};

// How far the robot may be from an unusual guess (variances in m and rad), and how much more of the scan, as a share,
// has to agree with what comes of it.
const Eigen::Vector3d kWide(0.25, 0.25, 0.1);
constexpr double kClearly = 0.05;

// Standard deviations between an answer and odometry.
double JumpOf(const Pose2& T_track_robot, const Pose2& guess, const Eigen::Matrix3d& covariance) {
  Eigen::Vector3d jump = T_track_robot.vector() - guess.vector();
  jump.z() = WrapAngle(jump.z());
  return std::sqrt(std::max(0.0, jump.dot(covariance.ldlt().solve(jump))));
}

}  // namespace

void Visit(OptionVisitor& visitor, NoOdometryOptions& options) {
  visitor.Flag("constant_velocity", options.constant_velocity,
               "The robot is expected to go on as between the last two scans; false: to stand still.");
  visitor.Real("sigma_m", options.sigma_m, "m", 0.001, 100.0, "Of the expectation; larger: the scan decides more.");
  visitor.Real("sigma_rad", options.sigma_rad, "rad", 0.001, kPi, "See sigma_m.");
  visitor.Real("unmatched_step_m", options.unmatched_step_m, "m", 0.0, 100.0,
               "What a scan without a match counts as travelled, towards being lost.");
  visitor.Integer(
      "merged_keyframes", options.merged_keyframes, "1", 1, 1000,
      "Keyframes whose points the matcher sees as one (of those kept); more: less pull towards standing still.");
}

void Visit(OptionVisitor& visitor, FrontEndOptions& options) {
  visitor.Section("features", "Lines and corners taken from a scan.", [&] { Visit(visitor, options.features); });
  visitor.Section("surface", "Points and surface directions taken from a scan.",
                  [&] { Visit(visitor, options.surface); });
  visitor.Section("refine", "Point-to-line alignment with the reference.", [&] {
    visitor.Flag("enabled", options.refine_enabled, "False: the matcher's own answer is the pose.");
    Visit(visitor, options.refine);
  });
  visitor.Section("odometry", "How far odometry is trusted between scans.", [&] { Visit(visitor, options.odometry); });
  visitor.Flag("use_odometry", options.use_odometry, "False: scans alone tell the motion.");
  visitor.Section("no_odometry", "What stands in for odometry where it is not used.",
                  [&] { Visit(visitor, options.no_odometry); });
  visitor.Integer("reference_keyframes", options.reference_keyframes, "1", 1, 1000,
                  "Keyframes matched against; more: steadier, until drift blurs them.");
  visitor.Real("retry_below", options.retry_below, "1", 0.0, 1.0,
               "Score under which other guesses than odometry are tried.");
  visitor.Real("keep_above", options.keep_above, "1", 0.0, 1.0,
               "Without refinement: score from which icp and correlative keep their reference; lower: less drift while "
               "it lasts, poorer matches.");
  visitor.Real("max_jump_sigma", options.max_jump_sigma, "1", 0.5, 1000.0,
               "Without refinement: matches farther from odometry than this are faults.");
}

FrontEnd::FrontEnd(const FrontEndOptions& options, MatcherKind matcher, const MatcherOptions& matching)
    : options_(options),
      matcher_(matcher),
      matching_(matching),
      keyframe_index_(options.refine.inlier_distance_m),
      index_(options.refine.first_pair_distance_m) {}

ScanView Look(const Scan& scan, const FrontEndOptions& options) {
  const std::vector<BeamPoint> points = PointsOf(scan);
  return {ExtractFeatures(points, scan, options.features), SurfacePointsOf(points, scan, options.surface)};
}

TrackStep FrontEnd::Track(const ScanView& view, const Pose2& T_odom_robot, const ParallelFor& parallel_for) {
  TrackStep step;
  if (started_) {
    const Guess guess = Predict(T_odom_robot);
    MatchResult coarse = MatchLastKeyframe(view, guess, parallel_for);
    // Points slide along a corridor slowly: the refinement must begin where it is to stay if they show nothing.
    if (!options_.use_odometry && options_.refine_enabled)
      TakeAlongFromPrior({guess.T_track_robot, guess.covariance}, coarse);
    step.match = options_.refine_enabled ? Refine(view, T_odom_robot, guess, coarse)
                                         : MatchAlone(view, T_odom_robot, guess, coarse, parallel_for);
    step.matcher = coarse.failure;
    step.matched = step.match.converged;
    step.moved_m = Between(T_track_robot_, step.match.T_prev_curr).translation().norm();
    if (!options_.use_odometry) {
      if (!step.matched) step.moved_m = std::max(step.moved_m, options_.no_odometry.unmatched_step_m);
      step.forecast_covariance = ForecastShare(step.match);
    }
    T_track_robot_ = step.match.T_prev_curr;
    score_ = step.match.score;
  }
  started_ = true;
  step.T_track_robot = T_track_robot_;
  history_.push_back({T_track_robot_, T_odom_robot});
  if (history_.size() > kHistory) history_.pop_front();
  return step;
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
  const Eigen::Vector3d sigma(expected.sigma_m, expected.sigma_m, expected.sigma_rad);
  return {last.T_track_robot * motion, sigma.cwiseAbs2().asDiagonal()};
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

// In track: the matcher itself works in the keyframe's frame.
MatchResult FrontEnd::MatchLastKeyframe(const ScanView& view, const Guess& guess,
                                        const ParallelFor& parallel_for) const {
  const Pose2& T_track_keyframe = keyframe_.T_track_robot;
  Eigen::Matrix3d R_track_keyframe = Eigen::Matrix3d::Identity();
  R_track_keyframe.topLeftCorner<2, 2>() = T_track_keyframe.rotation();
  const MatchPrior prior{Between(T_track_keyframe, guess.T_track_robot),
                         R_track_keyframe.transpose() * guess.covariance * R_track_keyframe};
  MatchResult match = MatchScans(keyframe_view_, view, prior, matcher_, matching_, parallel_for);
  match.T_prev_curr = T_track_keyframe * match.T_prev_curr;
  match.covariance = R_track_keyframe * match.covariance * R_track_keyframe.transpose();
  match.degenerate_direction = T_track_keyframe.rotation() * match.degenerate_direction;
  return match;
}

MatchResult FrontEnd::MatchAlone(const ScanView& view, const Pose2& T_odom_robot, const Guess& guess,
                                 const MatchResult& coarse, const ParallelFor& parallel_for) const {
  MatchResult best = coarse;
  // A forecast is nothing to find a fault with.
  if (options_.use_odometry && best.converged &&
      JumpOf(best.T_prev_curr, guess.T_track_robot, guess.covariance) > options_.max_jump_sigma) {
    best.converged = false;
    best.failure = MatchFailure::kFault;
  }
  // Not every matcher holds the prior along a corridor by itself.
  if (options_.use_odometry) TakeAlongFromPrior({guess.T_track_robot, guess.covariance}, best);
  double explained = Explained(view, best.converged ? best.T_prev_curr : guess.T_track_robot);
  const auto enough = [&] { return best.converged && explained >= options_.retry_below; };
  const auto consider = [&](const Pose2& other) {
    const MatchResult match = MatchLastKeyframe(view, {other, kWide.asDiagonal()}, parallel_for);
    if (!match.converged) return;
    const double share = Explained(view, match.T_prev_curr);
    if (share <= explained + kClearly) return;
    best = match;
    explained = share;
  };
  const bool retry = !SearchesWide(matcher_);
  if (retry && !enough())
    for (const Pose2& other : UnusualGuesses(T_odom_robot)) consider(other);
  for (std::size_t k = 0; retry && k < kTurns.size() && !enough(); ++k) {
    consider(guess.T_track_robot * Pose2{0, 0, kTurns[k]});
    consider(guess.T_track_robot * Pose2{0, 0, -kTurns[k]});
  }
  best.score = explained;
  if (best.converged && explained >= options_.refine.min_score) return best;
  if (best.converged) best.failure = MatchFailure::kInconsistent;
  best.converged = false;
  best.degenerate = false;
  best.T_prev_curr = guess.T_track_robot;
  best.covariance = guess.covariance;
  return best;
}

double FrontEnd::Explained(const ScanView& view, const Pose2& T_track_robot) const {
  return CompareSurfaces(view.points_robot, keyframe_index_, Between(keyframe_.T_track_robot, T_track_robot),
                         options_.refine.inlier_distance_m)
      .score;
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
  const auto align = [&](const Pose2& start) {
    return AlignPointsToSurfaces(view.points_robot, index_, {start, guess.T_track_robot, guess.covariance},
                                 options_.refine);
  };

  // The matcher says where to start; without it, odometry does.
  MatchResult best = align(coarse.converged ? coarse.T_prev_curr : guess.T_track_robot);
  if (best.converged && best.score >= options_.retry_below) return best;
  if (coarse.converged) {
    const MatchResult match = align(guess.T_track_robot);
    if (match.converged && (!best.converged || match.score > best.score)) best = match;
    if (best.converged && best.score >= options_.retry_below) return best;
  }

  // An unusual guess has to explain clearly more.
  const auto consider = [&](const Pose2& other) {
    const MatchResult match =
        AlignPointsToSurfaces(view.points_robot, index_, {other, other, kWide.asDiagonal()}, options_.refine);
    if (match.converged && (!best.converged || match.score > best.score + kClearly)) best = match;
  };
  for (const Pose2& other : UnusualGuesses(T_odom_robot)) consider(other);
  for (const double turn : kTurns) {
    if (best.converged && best.score >= options_.retry_below) break;
    consider(guess.T_track_robot * Pose2{0, 0, turn});
    consider(guess.T_track_robot * Pose2{0, 0, -turn});
  }
  return best;
}

void FrontEnd::AddKeyframe(const ScanView& view) {
  const bool matcher_alone = !options_.refine_enabled && !reference_.empty();
  if (matcher_alone && KeepsReference(matcher_) && score_ >= options_.keep_above) return;
  keyframe_ = history_.back();
  const Eigen::Matrix2d R = T_track_robot_.rotation();
  std::vector<SurfacePoint> points_track;
  points_track.reserve(view.points_robot.size());
  for (const SurfacePoint& point : view.points_robot)
    points_track.push_back({T_track_robot_ * point.p, R * point.normal});
  reference_.push_back(std::move(points_track));
  if (reference_.size() > static_cast<std::size_t>(options_.reference_keyframes)) reference_.pop_front();
  index_.Clear();
  for (const auto& points : reference_)
    for (const SurfacePoint& point : points) index_.Add(point);

  keyframe_view_ = view;
  if (!options_.use_odometry)
    keyframe_view_.points_robot = MergedPoints(static_cast<std::size_t>(options_.no_odometry.merged_keyframes));
  keyframe_index_.Clear();
  for (const SurfacePoint& point : keyframe_view_.points_robot) keyframe_index_.Add(point);
}

std::vector<SurfacePoint> FrontEnd::MergedPoints(std::size_t keyframes) const {
  const Pose2 T_keyframe_track = keyframe_.T_track_robot.Inverse();
  const Eigen::Matrix2d R = T_keyframe_track.rotation();
  std::vector<SurfacePoint> merged;
  for (std::size_t k = reference_.size() - std::min(keyframes, reference_.size()); k < reference_.size(); ++k)
    for (const SurfacePoint& point : reference_[k]) merged.push_back({T_keyframe_track * point.p, R * point.normal});
  return merged;
}

}  // namespace cairn::slam
