#include "server/slam/landmarks/landmark_pair.h"

namespace cairn::slam {

Innovation<2> Innovate(const LandmarkPosition& position, const Pose2& T_map_robot, const Eigen::Vector2d& z,
                       const Eigen::Matrix2d& R_z) {
  const RangeBearing predicted = PredictRangeBearing(T_map_robot, position.mean);
  Innovation<2> innovation;
  innovation.v = z - predicted.z;
  innovation.v.y() = WrapAngle(innovation.v.y());
  innovation.J_z_pose = predicted.J_z_pose;
  innovation.S_known_pose = predicted.J_z_point * position.covariance * predicted.J_z_point.transpose() + R_z;
  return innovation;
}

LandmarkPosition PositionAt(const Pose2& T_map_robot, const Eigen::Vector2d& z, const Eigen::Matrix2d& R_z) {
  const Eigen::Matrix2d J = J_point_z(T_map_robot, z);
  return {T_map_robot * Eigen::Vector2d(z.x() * std::cos(z.y()), z.x() * std::sin(z.y())), J * R_z * J.transpose()};
}

LandmarkPosition Moved(const LandmarkPosition& position, const Pose2& correction) {
  const Eigen::Matrix2d R = correction.rotation();
  return {correction * position.mean, R * position.covariance * R.transpose()};
}

void Update(LandmarkPosition& position, const Pose2& T_map_robot, const Eigen::Vector2d& z,
            const Eigen::Matrix2d& R_z) {
  const RangeBearing predicted = PredictRangeBearing(T_map_robot, position.mean);
  Eigen::Vector2d v = z - predicted.z;
  v.y() = WrapAngle(v.y());
  const Eigen::Matrix2d S = predicted.J_z_point * position.covariance * predicted.J_z_point.transpose() + R_z;
  const Eigen::Matrix2d K = position.covariance * predicted.J_z_point.transpose() * S.inverse();
  position.mean += K * v;
  const Eigen::Matrix2d P = (Eigen::Matrix2d::Identity() - K * predicted.J_z_point) * position.covariance;
  position.covariance = 0.5 * (P + P.transpose());
}

LandmarkPair::Measurement LandmarkPair::Measure(const LandmarkSighting& sighting, const LandmarkNoise& noise) {
  Measurement m;
  m.z_position = MeasureRangeBearing(sighting.p_robot);
  m.z_extension = MeasureRangeBearing(sighting.extension_robot());
  const Eigen::Matrix2d R_z =
      Eigen::Vector2d(noise.range_m * noise.range_m, noise.bearing_rad * noise.bearing_rad).asDiagonal();
  // The extension has the error of the position and, sideways, also the error of the slope.
  const Eigen::Matrix2d J = J_point_z({}, m.z_position);
  const Eigen::Vector2d sideways(-std::sin(sighting.slope), std::cos(sighting.slope));
  const Eigen::Matrix2d covariance =
      J * R_z * J.transpose() + noise.slope_rad * noise.slope_rad * sideways * sideways.transpose();
  const Eigen::Matrix2d J_z_point = PredictRangeBearing({}, sighting.extension_robot()).J_z_point;
  m.R_position = 2.0 * R_z;
  m.R_extension = 2.0 * J_z_point * covariance * J_z_point.transpose();
  return m;
}

double LandmarkPair::LogDensityAt(double nis, const Measurement& measurement) {
  return LogDensity<2>(0.5 * nis, 2.0 * measurement.R_position) +
         LogDensity<2>(0.5 * nis, 2.0 * measurement.R_extension);
}

LandmarkPair LandmarkPair::Initial(const Pose2& T_map_robot, const Measurement& measurement) {
  return {PositionAt(T_map_robot, measurement.z_position, measurement.R_position),
          PositionAt(T_map_robot, measurement.z_extension, measurement.R_extension)};
}

void LandmarkPair::Learn(const Pose2& T_map_robot, const Measurement& measurement) {
  Update(position, T_map_robot, measurement.z_position, measurement.R_position);
  Update(extension, T_map_robot, measurement.z_extension, measurement.R_extension);
}

double LandmarkPair::slope() const {
  const Eigen::Vector2d along = extension.mean - position.mean;
  return std::atan2(along.y(), along.x());
}

}  // namespace cairn::slam
