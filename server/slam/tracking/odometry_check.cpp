#include "server/slam/tracking/odometry_check.h"

#include <cmath>

#include "server/slam/tracking/surface_votes.h"

namespace cairn::slam {
namespace {

// A match that moves the robot otherwise than odometry by this, and this share of the step, must be shown by more
// surfaces than odometry is. Where it holds the robot back by half of the step, what moves along with it may be the
// cause, so there must be so many more. Not in turns, where odometry freezes and catches up. With more votes for every
// match, the online error on intel is twice as large.
constexpr double kContradictsM = 0.02, kContradictsShare = 0.1;
constexpr double kHeldBack = 0.5;
constexpr int kMoreVotes = 1, kMoreVotesHeldBack = 3;
constexpr double kTurnRad = 0.1;  // Larger turns are not checked.
constexpr double kHeldM = 0.002;  // Standard deviation that holds an alignment where it begins.

}  // namespace

MatchResult CheckAgainstOdometry(std::span<const SurfacePoint> points_robot, const PointIndex& reference,
                                 const CheckedStep& step, const MatchResult& match, const PointToLineOptions& options) {
  if (std::abs(step.T_from_robot.theta) > kTurnRad) return match;
  const Pose2 T_track_expected = step.T_track_from * step.T_from_robot;
  const Eigen::Vector2d expected = T_track_expected.translation() - step.T_track_from.translation();
  const Eigen::Vector2d moved = match.T_ref_curr.translation() - step.T_track_from.translation();
  const Eigen::Vector2d jump = moved - expected;
  const double step_m = expected.norm();
  if (jump.norm() < kContradictsM + kContradictsShare * step_m) return match;

  // As far as odometry says in this direction, else as the scan shows.
  const Eigen::Vector3d along = (Eigen::Vector3d() << jump.normalized(), 0.0).finished();
  const Eigen::Matrix3d others = Eigen::Matrix3d::Identity() - along * along.transpose();
  const Eigen::Matrix3d held = others * step.covariance * others + kHeldM * kHeldM * along * along.transpose();
  MatchResult odometry =
      AlignPointsToSurfaces(points_robot, reference, {T_track_expected, T_track_expected, held}, options);
  if (!odometry.converged) return match;
  const bool held_back = moved.dot(expected) < kHeldBack * step_m * step_m;
  const int votes = SurfaceVotes(points_robot, reference, odometry.T_ref_curr, match.T_ref_curr);
  if (votes >= (held_back ? kMoreVotesHeldBack : kMoreVotes)) return match;
  odometry.covariance += along.dot(step.covariance * along) * along * along.transpose();
  odometry.degenerate = true;
  odometry.degenerate_direction = along.head<2>();
  odometry.open_information = 0.0;
  return odometry;
}

}  // namespace cairn::slam
