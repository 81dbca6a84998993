// One hypothesis of a particle filter: where the robot is and how it came there. Its landmarks are the filter's, kept
// beside it. Copies share the path until they differ. Poses in `map`.
// Source: thesis A 4.1, (4-1); Montemerlo 2003 (FastSLAM 2.0).
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"
#include "server/slam/filters/shared_sequence.h"

namespace cairn::slam {

struct Particle {
  Pose2 T_map_robot;                                     // xv
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // pv: motion not yet sampled, (x, y, theta) in map.
  double log_weight = 0.0;                               // Since the last resampling.
  double log_likelihood = 0.0;                           // Of the whole path; survives resampling.
  SharedSequence<Pose2> path;                            // T_map_robot at every keyframe.
};

}  // namespace cairn::slam
