// One scan as the matchers and filters see it: what was extracted from it once, in the robot frame of the scan.
#pragma once

#include <vector>

#include "server/slam/features/line_feature.h"
#include "server/slam/matching/surface_points.h"

namespace cairn::slam {

struct ScanView {
  ScanFeatures features;
  std::vector<SurfacePoint> points_robot;
};

}  // namespace cairn::slam
