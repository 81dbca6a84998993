#include "server/slam/matching/match_covariance.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

struct LineVariance {
  double offset = 0.0;
  double slope = 0.0;
};

LineVariance VarianceOf(const LineFeature& line, const LineNoiseFloor& floor) {
  const double sigma = std::max(line.deviation, 2.0 * floor.offset_m);
  const double points = std::max(line.point_count, 2);
  const double length = std::max(line.length, 0.05);
  return {sigma * sigma / points + floor.offset_m * floor.offset_m,
          12.0 * sigma * sigma / (points * length * length) + floor.slope_rad * floor.slope_rad};
}

}  // namespace

Eigen::Matrix3d OdometryCovariance(const Pose2& T_ref_curr_odometry, const OdometryNoiseOptions& options) {
  const double distance = T_ref_curr_odometry.translation().norm();
  const double translation = options.translation_floor_m + options.translation_share * distance;
  const double rotation = options.rotation_floor_rad + options.rotation_per_m * distance +
                          options.rotation_share * std::abs(T_ref_curr_odometry.theta);
  return PoseCovariance(translation, rotation);
}

Eigen::Matrix3d PairsCovariance(const ScanFeatures& ref, const ScanFeatures& curr, std::span<const LinePair> pairs,
                                const MatchResult& result, const Eigen::Matrix3d& odometry_covariance,
                                const LineNoiseFloor& floor) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  double chi2 = 0.0;
  int residuals = 0;
  for (const LinePair& pair : pairs) {
    if (!pair.inlier) continue;
    const LineFeature& line_ref = ref.lines[static_cast<std::size_t>(pair.ref)];
    const LineFeature& line_curr = curr.lines[static_cast<std::size_t>(pair.curr)];
    const LineVariance a = VarianceOf(line_ref, floor), b = VarianceOf(line_curr, floor);
    const Eigen::Vector2d mid = result.T_ref_curr * line_curr.midpoint();
    const Eigen::Vector2d normal = line_ref.left_normal();
    // The two midpoints lie apart along the wall, and an error in the slope of either line acts over that
    // distance.
    const double apart = (mid - line_ref.midpoint()).norm();
    const double offset_variance = a.offset + b.offset + 0.25 * apart * apart * (a.slope + b.slope);
    const double slope_variance = a.slope + b.slope;

    Eigen::RowVector3d J_offset;
    J_offset << normal.transpose(),
        normal.dot(Eigen::Vector2d(result.T_ref_curr.y - mid.y(), mid.x() - result.T_ref_curr.x));
    information += J_offset.transpose() * J_offset / offset_variance;
    information(2, 2) += 1.0 / slope_variance;
    const double offset = line_ref.OffsetOf(mid);
    const double turn = AngleDiff(AngleDiff(line_ref.slope, line_curr.slope), result.T_ref_curr.theta);
    chi2 += offset * offset / offset_variance + turn * turn / slope_variance;
    residuals += 2;
  }
  if (residuals == 0) return odometry_covariance;
  information /= std::max(1.0, chi2 / std::max(1, residuals - 3));
  // The odometry supplies the information that is missing along a corridor. Elsewhere it must not reduce the
  // covariance, because the filter uses the odometry separately.
  if (result.degenerate) {
    const Eigen::Vector2d u = result.degenerate_direction;
    information.topLeftCorner<2, 2>() += u * u.transpose() / odometry_covariance(0, 0);
  }
  information.diagonal() += Eigen::Vector3d(1e-2, 1e-2, 1e-2);  // Keeps the matrix invertible for any pairs.
  const Eigen::Matrix3d covariance = information.ldlt().solve(Eigen::Matrix3d::Identity());
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace cairn::slam
