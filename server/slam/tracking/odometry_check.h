// What becomes of a match that odometry contradicts. People who walk along, and the ends of a short view in a corridor,
// move with the robot and hold it back; then odometry is right, and separate surfaces show it. Plain functions.
#pragma once

#include <Eigen/Core>
#include <span>

#include "server/slam/matching/point_index.h"
#include "server/slam/matching/point_to_line.h"

namespace cairn::slam {

// A shorter step tells nothing, because matches are no more exact. Where scans come faster than the robot drives this
// far, the step over several of them is checked, over at most twelve: a robot that drives less than 2.5 mm from scan to
// scan is not checked.
inline constexpr double kShortestCheckedStepM = 0.03;

// The motion since an earlier scan as odometry measured it, at least kShortestCheckedStepM.
struct CheckedStep {
  Pose2 T_track_from;
  Pose2 T_from_robot;
  // Of (x, y, theta), along the axes of `track`: how far the pose may be from it across the contradiction.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

// The match, or the pose that odometry gives in the direction in which the match contradicts it, if too few separate
// surfaces show that the match is right. In that direction the result is then degenerate. REQUIRES: match.converged,
// and all of it is in the frame `track` of the reference.
[[nodiscard]] MatchResult CheckAgainstOdometry(std::span<const SurfacePoint> points_robot, const PointIndex& reference,
                                               const CheckedStep& step, const MatchResult& match,
                                               const PointToLineOptions& options);

}  // namespace cairn::slam
