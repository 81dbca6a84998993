// How uncertain a matched or dead-reckoned step is: (x, y, theta) noise that grows with the distance and the turn.
// Source: the proportional model of thesis A (4-3), in the manner of Thrun et al. 2005, 5.4.
#pragma once

#include <Eigen/Core>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct MotionNoise {
  double trans_base_m = 0.0;   // Per step, whatever the motion.
  double trans_per_m = 0.0;    // Standard deviation of x and y per metre travelled.
  double trans_per_rad = 0.0;  // ... per radian turned.
  double rot_base_rad = 0.0;
  double rot_per_m = 0.0;    // Standard deviation of the heading per metre travelled.
  double rot_per_rad = 0.0;  // ... per radian turned.

  // Diagonal covariance of a step, in the frame the step starts from.
  [[nodiscard]] Eigen::Matrix3d Covariance(const Pose2& T_prev_curr) const;
};
void Visit(OptionVisitor& visitor, MotionNoise& options);

}  // namespace cairn::slam
