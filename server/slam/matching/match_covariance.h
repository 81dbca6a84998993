// How well matched lines tell the robot's motion: every pair informs about the offset across the line, by the scatter
// and number of its points, and about the turn, by its length as well. What lines leave open is what odometry leaves.
// Covariances are of (x, y, theta) of T_prev_curr, in prev. Stateless, thread-safe.
// Source: thesis A 3.5.14 argues the weights; information form as in thesis B (4.11)-(4.13).
#pragma once

#include <span>

#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/match_result.h"
#include "server/slam/matching/vote_table.h"
#include "server/slam/matching/voting_options.h"

namespace cairn::slam {

[[nodiscard]] Eigen::Matrix3d OdometryCovariance(const Pose2& T_prev_curr_odometry,
                                                 const OdometryTrustOptions& options);

// From the inliers among `pairs`, at result.T_prev_curr. Residuals larger than the lines' scatter explains widen it;
// `degenerate_direction` gets the odometry's variance.
[[nodiscard]] Eigen::Matrix3d PairsCovariance(const ScanFeatures& prev, const ScanFeatures& curr,
                                              std::span<const LinePair> pairs, const MatchResult& result,
                                              const Pose2& T_prev_curr_odometry, const VotingOptions& options);

}  // namespace cairn::slam
