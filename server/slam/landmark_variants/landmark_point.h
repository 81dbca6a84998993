// A landmark as one position, the form in FastSLAM 1.0 and the EKF. The slope of its first sighting is kept
// for data association only and gives no information about the pose. Frame `map`. Plain values.
// Source: thesis C (4.22)-(4.28), (4.35)-(4.37). Corrected: (4.29) shows standard deviations where variances
// belong.
#pragma once

#include <Eigen/Core>

#include "server/slam/landmarks/landmark_pair.h"

namespace cairn::slam {

struct LandmarkPoint {
  LandmarkPosition position;
  double first_slope = 0.0;

  struct Measurement {
    Eigen::Vector2d z;
    Eigen::Matrix2d R_z;
    double slope_robot = 0.0;
  };
  static constexpr int kNumbers = 2;
  static constexpr int kGateNumbers = 2;

  [[nodiscard]] static Measurement Measure(const LandmarkSighting& sighting, const LandmarkNoise& noise) {
    return {MeasureRangeBearing(sighting.p_robot),
            Eigen::Vector2d(noise.range_m * noise.range_m, noise.bearing_rad * noise.bearing_rad).asDiagonal(),
            sighting.slope};
  }
  [[nodiscard]] static double LogDensityAt(double nis, const Measurement& measurement) {
    return LogDensity<2>(nis, 2.0 * measurement.R_z);
  }
  [[nodiscard]] static LandmarkPoint Initial(const Pose2& T_map_robot, const Measurement& measurement) {
    return {PositionAt(T_map_robot, measurement.z, measurement.R_z),
            WrapAngle(T_map_robot.theta + measurement.slope_robot)};
  }

  [[nodiscard]] Innovation<2> GateInnovation(const Pose2& T_map_robot, const Measurement& measurement) const {
    return Innovate(position, T_map_robot, measurement.z, measurement.R_z);
  }
  template <typename Fuse>
  void ForEachInnovation(const Pose2& T_map_robot, const Measurement& measurement, const Fuse& fuse) const {
    fuse(GateInnovation(T_map_robot, measurement));
  }
  void Learn(const Pose2& T_map_robot, const Measurement& measurement) {
    Update(position, T_map_robot, measurement.z, measurement.R_z);
  }
  void Move(const Pose2& correction) {
    position = Moved(position, correction);
    first_slope = WrapAngle(first_slope + correction.theta);
  }

  [[nodiscard]] const Eigen::Vector2d& p_map() const { return position.mean; }
  [[nodiscard]] double slope() const { return first_slope; }
  [[nodiscard]] Eigen::Matrix2d covariance() const { return position.covariance; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.position, self.first_slope);
  }
};

}  // namespace cairn::slam
