// One hypothesis of FastSLAM: where the robot is, how it came there, and its own map of landmarks. Copies share path
// and landmarks until they differ. Poses in `map`. Source: thesis A 4.1, (4-1), (4-2); Montemerlo 2003 (FastSLAM 2.0).
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "common/geometry/pose2.h"
#include "server/slam/filters/shared_sequence.h"

namespace cairn::slam {

// One of the two positions that make a landmark (thesis A 4.4: a position alone does not tell the heading).
struct LandmarkPosition {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();        // xf
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  // pf
};

// Positions of a landmark: the feature itself, and a virtual one a metre along its slope.
struct LandmarkEstimate {
  LandmarkPosition position;
  LandmarkPosition extension;
  std::uint32_t sightings = 0;       // 0: this particle does not have the landmark.
  std::uint32_t first_keyframe = 0;  // It was first seen from here.
};

struct Particle {
  Pose2 T_map_robot;                                     // xv
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // pv: motion not yet sampled, (x, y, theta) in map.
  double log_weight = 0.0;                               // Since the last resampling.
  double log_likelihood = 0.0;                           // Of the whole path; survives resampling.
  SharedSequence<Pose2> path;                            // T_map_robot at every keyframe.
  SharedSequence<LandmarkEstimate> landmarks;            // By landmark id, the same in all particles.
};

}  // namespace cairn::slam
