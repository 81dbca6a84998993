// The estimate of the motion between two scans before they are matched, from odometry or a forecast.
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"

namespace cairn::slam {

struct MatchPrior {
  Pose2 T_ref_curr;                                          // Start of a matcher; the identity if unknown.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // Covariance of (x, y, theta), in ref.
};

}  // namespace cairn::slam
