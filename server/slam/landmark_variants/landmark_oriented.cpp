#include "server/slam/landmark_variants/landmark_oriented.h"

#include "common/geometry/rotated_covariance.h"

namespace cairn::slam {
namespace {

Eigen::Vector3d Difference(const Eigen::Vector3d& z, const Eigen::Vector3d& expected) {
  return {z.x() - expected.x(), AngleDiff(z.y(), expected.y()), AngleDiff(z.z(), expected.z())};
}

}  // namespace

OrientedPrediction PredictOriented(const Pose2& T_map_robot, const Eigen::Vector3d& landmark) {
  const RangeBearing point = PredictRangeBearing(T_map_robot, landmark.head<2>());
  OrientedPrediction predicted;
  predicted.z << point.z, AngleDiff(landmark.z(), T_map_robot.theta);
  predicted.J_z_pose << point.J_z_pose, 0, 0, -1;
  predicted.J_z_landmark.setZero();
  predicted.J_z_landmark.topLeftCorner<2, 2>() = point.J_z_point;
  predicted.J_z_landmark(2, 2) = 1.0;
  return predicted;
}

LandmarkOriented::Measurement LandmarkOriented::Measure(const LandmarkSighting& sighting, const LandmarkNoise& noise) {
  Measurement m;
  m.z << MeasureRangeBearing(sighting.p_robot), sighting.slope;
  m.R_z = Eigen::Vector3d(noise.range_m, noise.bearing_rad, noise.slope_rad).cwiseAbs2().asDiagonal();
  return m;
}

LandmarkOriented LandmarkOriented::Initial(const Pose2& T_map_robot, const Measurement& measurement) {
  const Eigen::Vector3d& z = measurement.z;
  LandmarkOriented landmark;
  landmark.mean << T_map_robot * Eigen::Vector2d(z.x() * std::cos(z.y()), z.x() * std::sin(z.y())),
      WrapAngle(T_map_robot.theta + z.z());
  Eigen::Matrix3d Gz = Eigen::Matrix3d::Identity();
  Gz.topLeftCorner<2, 2>() = J_point_z(T_map_robot, z.head<2>());
  landmark.P = Gz * measurement.R_z * Gz.transpose();
  return landmark;
}

Innovation<3> LandmarkOriented::GateInnovation(const Pose2& T_map_robot, const Measurement& measurement) const {
  const OrientedPrediction predicted = PredictOriented(T_map_robot, mean);
  return {Difference(measurement.z, predicted.z), predicted.J_z_pose,
          predicted.J_z_landmark * P * predicted.J_z_landmark.transpose() + measurement.R_z};
}

void LandmarkOriented::Learn(const Pose2& T_map_robot, const Measurement& measurement) {
  const OrientedPrediction predicted = PredictOriented(T_map_robot, mean);
  const Eigen::Matrix3d S = predicted.J_z_landmark * P * predicted.J_z_landmark.transpose() + measurement.R_z;
  const Eigen::Matrix3d K = P * predicted.J_z_landmark.transpose() * S.inverse();
  mean += K * Difference(measurement.z, predicted.z);
  mean.z() = WrapAngle(mean.z());
  const Eigen::Matrix3d updated = (Eigen::Matrix3d::Identity() - K * predicted.J_z_landmark) * P;
  P = 0.5 * (updated + updated.transpose());
}

void LandmarkOriented::Move(const Pose2& correction) {
  mean << correction * Eigen::Vector2d(mean.head<2>()), WrapAngle(mean.z() + correction.theta);
  P = Rotated(P, correction.theta);
}

}  // namespace cairn::slam
