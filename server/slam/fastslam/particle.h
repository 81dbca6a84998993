// One hypothesis of a particle filter: the pose of the robot and the path to it. The filter stores the
// landmarks of each particle separately. Copies share the path until they differ. Poses in `map`.
// Source: thesis A 4.1, (4-1); Montemerlo 2003 (FastSLAM 2.0).
#pragma once

#include <Eigen/Core>

#include "common/geometry/pose2.h"
#include "server/slam/trail/shared_sequence.h"

namespace cairn::slam {

struct Particle {
  Pose2 T_map_robot;  // Pose of the robot; xv in the thesis.
  // pv: covariance of the motion not yet sampled, (x, y, theta) in map.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double log_weight = 0.0;      // Sum since the last resampling.
  double log_likelihood = 0.0;  // Log likelihood of the whole path; resampling keeps it.
  SharedSequence<Pose2> path;   // T_map_robot at every keyframe.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.T_map_robot, self.covariance, self.log_weight, self.log_likelihood, self.path);
  }
};

}  // namespace cairn::slam
