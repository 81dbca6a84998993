// How well a scan's points lie on the surfaces of another scan at a given transform: the common yardstick of matchers
// that do not minimise this distance themselves. Not a matcher: the transform is taken as it is.
// Points in `curr`, reference in `prev`. Stateless, thread-safe.
#pragma once

#include <Eigen/Core>
#include <span>

#include "common/geometry/pose2.h"
#include "server/slam/matching/point_index.h"

namespace cairn::slam {

struct SurfaceAgreement {
  int inliers = 0;     // Points nearer than the distance given to a surface that faces the same way.
  double score = 0.0;  // Their share of all points.
  double rms_m = 0.0;  // Of their distances across the surface.
  // Information of (x, y, theta) of the transform from the points with a surface direction, per unit variance.
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
};

[[nodiscard]] SurfaceAgreement CompareSurfaces(std::span<const SurfacePoint> points_curr, const PointIndex& reference,
                                               const Pose2& T_prev_curr, double distance_m);

}  // namespace cairn::slam
