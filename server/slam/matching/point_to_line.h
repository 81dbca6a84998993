// Aligns the surface points of a scan with a reference set by point-to-line ICP. The guess takes part as a
// prior with its covariance: where the reference constrains nothing (along a corridor) the result stays at
// the prior, elsewhere the scan decides. Not a global search: the initial error must be below about 0.5 m and
// 20 degrees.
// Reference points without a surface direction (rough or sparse surfaces) are paired point to point with a
// smaller weight; without them the results on the real logs are ten times worse. Frames: points in `robot`,
// reference in `ref`; the result is T_ref_robot. Stateless, thread-safe.
// Source: Censi, ICRA 2008 (metric); Cauchy weights; with the prior the result is the maximum a posteriori
// estimate.
#pragma once

#include <Eigen/Core>
#include <span>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

// Measures how well the points of a scan lie on the surfaces of another scan at a given transform. It is the
// common measure for matchers that do not minimise this distance themselves. Not a matcher: the transform is
// not changed.
// Points are in `curr`, the reference is in `ref`. Stateless, thread-safe.
struct SurfaceAgreement {
  int inliers = 0;     // Points within the given distance of a surface that faces the same way.
  double score = 0.0;  // Share of the inliers among all points.
  double rms_m = 0.0;  // Root mean square distance of the inliers across their surfaces.
  // Information on (x, y, theta) of the transform from the points with a surface direction, for unit
  // variance.
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
};

[[nodiscard]] SurfaceAgreement CompareSurfaces(std::span<const SurfacePoint> points_curr, const PointIndex& reference,
                                               const Pose2& T_ref_curr, double distance_m);

struct PointToLineOptions {
  std::int64_t max_iterations = 20;
  double first_pair_distance_m = 0.5;
  double last_pair_distance_m = 0.2;
  double residual_sigma_m = 0.04;
  double stop_step_m = 5e-4;
  double inlier_distance_m = 0.12;
  double min_score = 0.4;
  double rough_trust = 0.2;
  double same_side = 0.5;
  double cauchy_share = 0.25;
  std::int64_t shrink_iterations = 6;
};
void Visit(OptionVisitor& visitor, PointToLineOptions& options);

// The pose at which the iteration starts, and the prior. Usually both are the same pose.
struct AlignmentGuess {
  Pose2 T_ref_robot_start;
  Pose2 T_ref_robot_prior;
  Eigen::Matrix3d prior_covariance;  // Covariance of (x, y, theta) of the prior, along the axes of `ref`.
  // Where a smaller share of the points is explained after the first `settling` iterations, the caller has no use for
  // the result. The iteration is given up then, and has not converged.
  double least_score = 0.0;
  int settling = 0;
};

// T_ref_curr of the result is T_ref_robot; it is the prior if the iteration did not converge.
[[nodiscard]] MatchResult AlignPointsToSurfaces(std::span<const SurfacePoint> points_robot, const PointIndex& reference,
                                                const AlignmentGuess& guess, const PointToLineOptions& options);

}  // namespace cairn::slam
