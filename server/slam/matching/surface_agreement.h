// Measures how well the points of a scan lie on the surfaces of another scan at a given transform. It is the
// common measure for matchers that do not minimise this distance themselves. Not a matcher: the transform is
// not changed.
// Points are in `curr`, the reference is in `ref`. Stateless, thread-safe.
#pragma once

#include <Eigen/Core>
#include <span>

#include "common/geometry/pose2.h"
#include "server/slam/scan/point_index.h"

namespace cairn::slam {

struct SurfaceAgreement {
  int inliers = 0;     // Points within the given distance of a surface that faces the same way.
  double score = 0.0;  // Share of the inliers among all points.
  double rms_m = 0.0;  // Root mean square distance of the inliers across their surfaces.
  // Information on (x, y, theta) of the transform from the points with a surface direction, for unit
  // variance.
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
};

[[nodiscard]] SurfaceAgreement CompareSurfaces(std::span<const SurfacePoint> points_curr, const PointIndex& reference,
                                               const Pose2& T_ref_curr, double distance_m);

}  // namespace cairn::slam
