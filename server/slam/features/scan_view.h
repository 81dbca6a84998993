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

// The bare positions of a scan's points, for matchers that do not use surface directions. In the robot frame
// of the scan.
[[nodiscard]] inline std::vector<Eigen::Vector2d> PositionsOf(const ScanView& view) {
  std::vector<Eigen::Vector2d> positions;
  positions.reserve(view.points_robot.size());
  for (const SurfacePoint& point : view.points_robot) positions.push_back(point.p);
  return positions;
}

}  // namespace cairn::slam
