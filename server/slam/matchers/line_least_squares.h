// The motion between two scans by least squares over pairs of lines that are known to be the same walls:
// Gauss-Newton on SE(2), where a line is its midpoint and its normal. Does not find the pairs (see
// line_association.h).
// Frames: lines in the robot frames of their scans; returns T_ref_curr. Stateless, thread-safe,
// deterministic.
// Source: thesis B 3.5, 4.3.1, (4.4)-(4.17). Corrected: (4.10) is the Jacobian at the transformed line;
// (4.11) is an information matrix, not a covariance; (4.12) lacks the transpose of its second rotation;
// (4.16) lacks a minus sign; (5.3) has the transpose on the wrong side. Normals point towards the laser, not
// away from the origin as in (4.5), so that they do not flip when the robot crosses the extension of a wall.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/line_feature.h"

namespace cairn::slam {

// (4.4): the midpoint of a line and its unit normal towards the laser.
struct PointNormal {
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  Eigen::Vector2d n = Eigen::Vector2d::UnitX();
};
[[nodiscard]] PointNormal MidpointAndNormal(const LineFeature& line);

// (4.7): the line transformed by T.
[[nodiscard]] PointNormal Transform(const Pose2& T, const PointNormal& line);

// (4.8): the error of the current line, moved into ref, relative to the previous line.
[[nodiscard]] Eigen::Vector4d LineError(const PointNormal& moved, const PointNormal& ref);

// (4.10): d(error) / d(step). The step (x, y, theta) is applied from the left to the transform that moved the
// line.
[[nodiscard]] Eigen::Matrix<double, 4, 3> J_error_step(const PointNormal& moved);

struct LineLeastSquaresOptions {
  double along_weight = 1e-3;  // Weight of the direction along the wall, (4.12).
  double normal_weight = 0.1;  // Weight of the normal for a line of 1 m, (4.11).
  double length_power = 1.0;
  std::int64_t max_iterations = 30;
  double stop_step = 1e-7;  // Norm of the last step (m and rad); cannot be configured.
};
void Visit(OptionVisitor& visitor, LineLeastSquaresOptions& options);

// (4.11)-(4.13): the information matrix of a pair whose previous line has this normal, before weighting by
// length.
[[nodiscard]] Eigen::Matrix4d LineInformation(const Eigen::Vector2d& normal_ref, double along_weight,
                                              double normal_weight);

// A pair of lines with its weight.
struct WeightedPair {
  PointNormal ref, curr;
  double length = 1.0;  // Length of the shorter line, m.
};

struct LineAlignment {
  Pose2 T_ref_curr;
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();  // (4.15) at the result, without the part due to along_weight.
  // (5.3) summed over the pairs, before each step and after the last.
  std::vector<double> chi;
  bool converged = false;  // True if the steps became shorter than stop_step.
};

[[nodiscard]] LineAlignment AlignLinePairs(std::span<const WeightedPair> pairs, const Pose2& T_ref_curr_start,
                                           const LineLeastSquaresOptions& options);

}  // namespace cairn::slam
