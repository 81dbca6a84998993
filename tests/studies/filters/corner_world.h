// A world of corners for studies of filters. What a front-end would see of it is drawn at random, not
// computed. Frame `map`.
#pragma once

#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/features/scan_view.h"
#include "server/slam/landmarks/landmark_options.h"
#include "server/slam/random/resampling.h"

namespace cairn::studies {

struct Corner {
  Eigen::Vector2d p_map;
  double slope = 0.0;  // Slope of the corner's first line, rad.
  double angle = 1.5;  // Angle between the corner's lines, signed, rad.
};

// The corners in the front half-circle of kCornerSightM around the robot, with `factor` times the noise.
inline constexpr double kCornerSightM = 6.0;
[[nodiscard]] slam::ScanView SeenCorners(const std::vector<Corner>& corners, const Pose2& T_map_robot,
                                         const slam::LandmarkNoise& noise, double factor, slam::Rng& rng);

}  // namespace cairn::studies
