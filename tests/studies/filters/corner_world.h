// A world of corners for studies of filters: what a front-end would see of it is drawn, not computed. Frame `map`.
#pragma once

#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/filters/landmark_options.h"
#include "server/slam/filters/resampling.h"
#include "server/slam/matching/scan_view.h"

namespace cairn::studies {

struct Corner {
  Eigen::Vector2d p_map;
  double slope = 0.0;  // Of its first line, rad.
  double angle = 1.5;  // Between its lines, signed, rad.
};

// The corners in the front half-circle of kCornerSightM around the robot, with `factor` times the noise.
inline constexpr double kCornerSightM = 6.0;
[[nodiscard]] slam::ScanView SeenCorners(const std::vector<Corner>& corners, const Pose2& T_map_robot,
                                         const slam::LandmarkNoise& noise, double factor, slam::Rng& rng);

}  // namespace cairn::studies
