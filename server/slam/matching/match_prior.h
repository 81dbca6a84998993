// What is believed of a motion between two scans before they are matched, from odometry or a forecast.
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"

namespace cairn::slam {

struct MatchPrior {
  Pose2 T_prev_curr;  // Where a matcher starts; the identity where nothing is known.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // Of (x, y, theta), in prev.
};

}  // namespace cairn::slam
