// The covariance of a motion that follows from matched lines. Every pair of lines gives information on the
// offset across the line, according to the scatter and number of its points, and on the turn, according to
// its length as well. What the lines do not constrain has the covariance of the odometry. Covariances are
// those of (x, y, theta) of T_ref_curr, in `ref`. Stateless, thread-safe.
// Source: thesis A 3.5.14 argues the weights; information form as in thesis B (4.11)-(4.13).
#pragma once

#include <span>

#include "common/geometry/angle.h"
#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/matching/vote_table.h"

namespace cairn::slam {

// Standard deviations of the odometry where it replaces the lines: sigma = floor + share * motion.
struct OdometryNoiseOptions {
  double translation_floor_m = 0.02;
  double translation_share = 0.10;
  double rotation_floor_rad = Radians(1.0);
  double rotation_share = 0.10;
  double rotation_per_m = Radians(2.0);
};

// Lower bounds of the standard deviations of a line's offset and slope.
struct LineNoiseFloor {
  double offset_m = 0.004;
  double slope_rad = Radians(0.15);
};

[[nodiscard]] Eigen::Matrix3d OdometryCovariance(const Pose2& T_ref_curr_odometry, const OdometryNoiseOptions& options);

// Computed from the inliers among `pairs` at result.T_ref_curr. Residuals that are larger than the scatter of
// the lines explains increase the covariance. Along `degenerate_direction` it has the variance of the
// odometry.
[[nodiscard]] Eigen::Matrix3d PairsCovariance(const ScanFeatures& ref, const ScanFeatures& curr,
                                              std::span<const LinePair> pairs, const MatchResult& result,
                                              const Eigen::Matrix3d& odometry_covariance, const LineNoiseFloor& floor);

}  // namespace cairn::slam
