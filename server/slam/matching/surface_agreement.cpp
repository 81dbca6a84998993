#include "server/slam/matching/surface_agreement.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {

SurfaceAgreement CompareSurfaces(std::span<const SurfacePoint> points_curr, const PointIndex& reference,
                                 const Pose2& T_ref_curr, double distance_m) {
  SurfaceAgreement sum;
  const Eigen::Matrix2d R = T_ref_curr.rotation();
  double squares = 0.0;
  for (const SurfacePoint& point : points_curr) {
    const Eigen::Vector2d turned = R * point.p, p_ref = turned + T_ref_curr.translation();
    const SurfacePoint* nearest = reference.Nearest(p_ref, distance_m);
    if (nearest == nullptr) continue;
    const bool directed = nearest->smooth() && point.smooth();
    // The point lies on the other side of a thin wall.
    if (directed && nearest->normal.dot(R * point.normal) < 0.5) continue;
    ++sum.inliers;
    const Eigen::Vector2d offset = p_ref - nearest->p;
    const double across = nearest->smooth() ? nearest->normal.dot(offset) : offset.norm();
    squares += across * across;
    if (!directed) continue;
    const Eigen::Vector3d J(nearest->normal.x(), nearest->normal.y(),
                            nearest->normal.dot(Eigen::Vector2d(-turned.y(), turned.x())));
    sum.H.noalias() += J * J.transpose();
  }
  if (sum.inliers == 0) return sum;
  sum.score = static_cast<double>(sum.inliers) / static_cast<double>(points_curr.size());
  sum.rms_m = std::sqrt(squares / sum.inliers);
  return sum;
}

}  // namespace cairn::slam
