// One scan as the matchers and filters use it: the features and surface points that were extracted from it,
// in the robot frame of the scan.
#pragma once

#include <vector>

#include "server/slam/features/line_feature.h"
#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

struct ScanView {
  ScanFeatures features;
  std::vector<SurfacePoint> points_robot;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.features, self.points_robot);
  }
};

}  // namespace cairn::slam
