// The motion between two scans by least squares over pairs of lines that are known to be the same walls: Gauss-Newton
// on SE(2) with a line as its midpoint and its normal. Does not find the pairs: line_association.h does. Frames: lines
// in the robot frames of their scans, answer T_prev_curr. Stateless, thread-safe, deterministic. Source: thesis
// B 3.5, 4.3.1, (4.4)-(4.17). Put right: (4.10) is the Jacobian at the transformed line; (4.11) is an information
// matrix, not a covariance; (4.12) lacks the transpose of its second rotation; (4.16) lacks a minus sign; (5.3) has the
// transpose on the wrong side. Normals point to where the laser was, not away from the origin as (4.5) does, so that
// they do not flip when the robot passes through a wall's line.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/line_feature.h"

namespace cairn::slam {

// (4.4): a point of the line, and its unit normal towards the laser.
struct PointNormal {
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  Eigen::Vector2d n = Eigen::Vector2d::UnitX();
};
[[nodiscard]] PointNormal MidpointAndNormal(const LineFeature& line);

// (4.7)
[[nodiscard]] PointNormal Transform(const Pose2& T, const PointNormal& line);

// (4.8): of the current line, moved into prev, against the previous one.
[[nodiscard]] Eigen::Vector4d LineError(const PointNormal& moved, const PointNormal& prev);

// (4.10): d(error) / d(step) where the step (x, y, theta) is applied from the left to the transform that moved the
// line.
[[nodiscard]] Eigen::Matrix<double, 4, 3> J_error_step(const PointNormal& moved);

struct LineLeastSquaresOptions {
  double along_weight = 1e-3;  // epsilon of (4.12): how far a midpoint counts along its wall; the visible part of a
                               // wall differs from scan to scan, so more is wrong and none leaves a corridor singular.
  double normal_weight = 0.1;  // alpha of (4.11): a slope's share per square metre of line (at 1 m: this).
  double length_power = 1.0;   // Weight of a pair by length; 0: the thesis, all the same.
  std::int64_t max_iterations = 30;  // Typical: 4. The thesis runs 100.
  double stop_step = 1e-7;           // Stops when the step (m, rad) is smaller.
};
void Visit(OptionVisitor& visitor, LineLeastSquaresOptions& options);

// (4.11)-(4.13), for a pair whose previous line has this normal, before weighting by length.
[[nodiscard]] Eigen::Matrix4d LineInformation(const Eigen::Vector2d& normal_prev, double along_weight,
                                              double normal_weight);

// A pair as the least squares see it.
struct WeighedPair {
  PointNormal prev, curr;
  double length = 1.0;  // Of the shorter one.
};

struct LineAlignment {
  Pose2 T_prev_curr;
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();  // (4.15) at the answer, without what along_weight adds.
  std::vector<double> chi;                      // (5.3) summed over the pairs, before each step and after the last.
  bool converged = false;                       // The steps went to nothing.
};

[[nodiscard]] LineAlignment AlignLinePairs(std::span<const WeighedPair> pairs, const Pose2& T_prev_curr_start,
                                           const LineLeastSquaresOptions& options);

}  // namespace cairn::slam
