#include "server/slam/front_end.h"

#include <array>

namespace cairn::slam {
namespace {

// Scans back from which odometry is also tried: where it froze and then caught up, or came late, the step since the
// last scan is wrong although the way over several is right.
constexpr std::array<std::size_t, 3> kLookBack = {3, 6, 12};
constexpr std::size_t kHistory = 16;

// Turns tried about the guess, either way, while nothing explains the scan: odometry that froze in a turn.
constexpr std::array<double, 4> kTurns = {0.25, 0.5, 0.75, 1.0};

}  // namespace

void Visit(OptionVisitor& visitor, FrontEndOptions& options) {
  visitor.Section("features", "Lines and corners taken from a scan.", [&] { Visit(visitor, options.features); });
  visitor.Section("voting", "Seven criteria vote for pairs of lines.", [&] { Visit(visitor, options.voting); });
  visitor.Section("surface", "Points and surface directions taken from a scan.",
                  [&] { Visit(visitor, options.surface); });
  visitor.Section("refine", "Point-to-line alignment with the reference.", [&] { Visit(visitor, options.refine); });
  visitor.Section("odometry", "How far odometry is trusted between scans.", [&] { Visit(visitor, options.odometry); });
  visitor.Integer("reference_keyframes", options.reference_keyframes, "1", 1, 1000,
                  "Keyframes matched against; more: steadier, until drift blurs them.");
  visitor.Real("retry_below", options.retry_below, "1", 0.0, 1.0,
               "Score under which other guesses than odometry are tried.");
}

FrontEnd::FrontEnd(const FrontEndOptions& options) : options_(options), index_(options.refine.first_pair_distance_m) {}

ScanView Look(const Scan& scan, const FrontEndOptions& options) {
  const std::vector<BeamPoint> points = PointsOf(scan);
  return {ExtractFeatures(points, scan, options.features), SurfacePointsOf(points, scan, options.surface)};
}

TrackStep FrontEnd::Track(const ScanView& view, const Pose2& T_odom_robot) {
  TrackStep step;
  if (started_) {
    step.match = Align(view, T_odom_robot, step.voting);
    step.matched = step.match.converged;
    step.moved_m = Between(T_track_robot_, step.match.T_prev_curr).translation().norm();
    T_track_robot_ = step.match.T_prev_curr;
  }
  started_ = true;
  step.T_track_robot = T_track_robot_;
  history_.push_back({T_track_robot_, T_odom_robot});
  if (history_.size() > kHistory) history_.pop_front();
  return step;
}

MatchResult FrontEnd::Align(const ScanView& view, const Pose2& T_odom_robot, MatchFailure& voting) const {
  const Sight& last = history_.back();
  const Pose2 motion = Between(last.T_odom_robot, T_odom_robot);
  const Pose2 guess = last.T_track_robot * motion;
  const Eigen::Matrix3d J = J_compose_right(last.T_track_robot, motion);
  const Eigen::Matrix3d prior = J * options_.odometry.Covariance(motion) * J.transpose();
  const auto align = [&](const Pose2& start) {
    return AlignPointsToSurfaces(view.points_robot, index_, {start, guess, prior}, options_.refine);
  };

  // The lines say where to start; without them, odometry does.
  const MatchResult lines =
      MatchByVoting(keyframe_features_, view.features, Between(keyframe_.T_track_robot, guess), options_.voting);
  voting = lines.failure;
  MatchResult best = align(lines.converged ? keyframe_.T_track_robot * lines.T_prev_curr : guess);
  if (best.converged && best.score >= options_.retry_below) return best;
  if (lines.converged) {
    const MatchResult match = align(guess);
    if (match.converged && (!best.converged || match.score > best.score)) best = match;
    if (best.converged && best.score >= options_.retry_below) return best;
  }

  // An unusual guess has to explain clearly more.
  const Eigen::Matrix3d wide = Eigen::Vector3d(0.25, 0.25, 0.1).asDiagonal();
  const auto consider = [&](const Pose2& other) {
    const MatchResult match = AlignPointsToSurfaces(view.points_robot, index_, {other, other, wide}, options_.refine);
    if (match.converged && (!best.converged || match.score > best.score + 0.05)) best = match;
  };
  consider(last.T_track_robot);
  for (const std::size_t back : kLookBack) {
    if (history_.size() < back) continue;
    const Sight& sight = history_[history_.size() - back];
    consider(sight.T_track_robot * Between(sight.T_odom_robot, T_odom_robot));
  }
  for (const double turn : kTurns) {
    if (best.converged && best.score >= options_.retry_below) break;
    consider(guess * Pose2{0, 0, turn});
    consider(guess * Pose2{0, 0, -turn});
  }
  return best;
}

void FrontEnd::AddKeyframe(const ScanView& view) {
  keyframe_ = history_.back();
  keyframe_features_ = view.features;
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
}

}  // namespace cairn::slam
