// The uncertainty of a matched or dead-reckoned step: noise of (x, y, theta) that grows with the distance and
// the turn.
// Source: the proportional model of thesis A (4-3), in the manner of Thrun et al. 2005, 5.4.
#pragma once

#include <Eigen/Core>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct MotionNoise {
  double trans_base_m = 0.0;
  double trans_per_m = 0.0;
  double trans_per_rad = 0.0;
  double rot_base_rad = 0.0;
  double rot_per_m = 0.0;
  double rot_per_rad = 0.0;

  // Diagonal covariance of (x, y, theta) of a step, in the frame in which the step starts.
  [[nodiscard]] Eigen::Matrix3d Covariance(const Pose2& T_prev_curr) const;
};
void Visit(OptionVisitor& visitor, MotionNoise& options);

}  // namespace cairn::slam
