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

LineVariance VarianceOf(const LineFeature& line, const VotingOptions& options) {
  const double sigma = std::max(line.deviation, 2.0 * options.line_sigma_floor_m);
  const double points = std::max(line.point_count, 2);
  const double length = std::max(line.length, 0.05);
  const double place_floor = options.line_sigma_floor_m, slope_floor = options.line_slope_sigma_floor_rad;
  return {sigma * sigma / points + place_floor * place_floor,
          12.0 * sigma * sigma / (points * length * length) + slope_floor * slope_floor};
}

}  // namespace

Eigen::Matrix3d OdometryCovariance(const Pose2& T_prev_curr_odometry, const OdometryTrustOptions& options) {
  const double distance = T_prev_curr_odometry.translation().norm();
  const double translation = options.translation_floor_m + options.translation_share * distance;
  const double rotation = options.rotation_floor_rad + options.rotation_per_m * distance +
                          options.rotation_share * std::abs(T_prev_curr_odometry.theta);
  return Eigen::Vector3d(translation * translation, translation * translation, rotation * rotation).asDiagonal();
}

Eigen::Matrix3d PairsCovariance(const ScanFeatures& prev, const ScanFeatures& curr, std::span<const LinePair> pairs,
                                const MatchResult& result, const Pose2& T_prev_curr_odometry,
                                const VotingOptions& options) {
  Eigen::Matrix3d odometry = OdometryCovariance(T_prev_curr_odometry, options.odometry);
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  double chi2 = 0.0;
  int residuals = 0;
  for (const LinePair& pair : pairs) {
    if (!pair.inlier) continue;
    const LineFeature& line_prev = prev.lines[static_cast<std::size_t>(pair.prev)];
    const LineFeature& line_curr = curr.lines[static_cast<std::size_t>(pair.curr)];
    const LineVariance a = VarianceOf(line_prev, options), b = VarianceOf(line_curr, options);
    const Eigen::Vector2d mid = result.T_prev_curr * line_curr.midpoint();
    const Eigen::Vector2d normal = line_prev.left_normal();
    // The middles lie apart along the wall; a wrong slope of either line carries over that distance.
    const double apart = (mid - line_prev.midpoint()).norm();
    const double offset_variance = a.offset + b.offset + 0.25 * apart * apart * (a.slope + b.slope);
    const double slope_variance = a.slope + b.slope;

    Eigen::RowVector3d J_offset;
    J_offset << normal.transpose(),
        normal.dot(Eigen::Vector2d(result.T_prev_curr.y - mid.y(), mid.x() - result.T_prev_curr.x));
    information += J_offset.transpose() * J_offset / offset_variance;
    information(2, 2) += 1.0 / slope_variance;
    const double offset = line_prev.OffsetOf(mid);
    const double turn = AngleDiff(AngleDiff(line_prev.slope, line_curr.slope), result.T_prev_curr.theta);
    chi2 += offset * offset / offset_variance + turn * turn / slope_variance;
    residuals += 2;
  }
  if (residuals == 0) return odometry;
  information /= std::max(1.0, chi2 / std::max(1, residuals - 3));
  // Odometry closes what is open. Elsewhere it must not narrow the answer: the filter uses it in its own right.
  if (result.degenerate) {
    const Eigen::Vector2d u = result.degenerate_direction;
    information.topLeftCorner<2, 2>() += u * u.transpose() / odometry(0, 0);
  }
  information.diagonal() += Eigen::Vector3d(1e-2, 1e-2, 1e-2);  // Invertible whatever the pairs.
  const Eigen::Matrix3d covariance = information.ldlt().solve(Eigen::Matrix3d::Identity());
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace cairn::slam
