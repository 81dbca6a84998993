// A landmark whose position and orientation are estimated in one filter (FS_3LS_1LP) from range, bearing and
// relative slope. Frame `map`; the pose of the observer is taken as known, as in each particle. Plain values.
// Source: thesis A 4.7, (4-20)-(4-25). Corrected: Hf in (4-25) has a 1 for the derivative of the bearing by
// the landmark's angle, which is zero; Gz (4-22) is the Jacobian with respect to the measurement; (4-23)
// needs atan2 and wrapping.
#pragma once

#include <Eigen/Core>

#include "server/slam/landmarks/innovation.h"
#include "server/slam/landmarks/landmark_sighting.h"

namespace cairn::slam {

// (4-23)-(4-25): predicted range, bearing and slope of a landmark (x, y, gamma) seen from a pose.
struct OrientedPrediction {
  Eigen::Vector3d z;
  Eigen::Matrix3d J_z_pose;      // Hv of the thesis.
  Eigen::Matrix3d J_z_landmark;  // Hf of the thesis.
};
[[nodiscard]] OrientedPrediction PredictOriented(const Pose2& T_map_robot, const Eigen::Vector3d& landmark);

struct LandmarkOriented {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();  // lm_x, lm_y, lm_gamma
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();

  struct Measurement {
    Eigen::Vector3d z;  // Range, bearing and slope, (4-20).
    Eigen::Matrix3d R_z;
  };
  static constexpr int kNumbers = 3;
  static constexpr int kGateNumbers = 3;

  [[nodiscard]] static Measurement Measure(const LandmarkSighting& sighting, const LandmarkNoise& noise);
  [[nodiscard]] static double LogDensityAt(double nis, const Measurement& measurement) {
    return LogDensity<3>(nis, 2.0 * measurement.R_z);
  }
  // Initialisation from one measurement, (4-21).
  [[nodiscard]] static LandmarkOriented Initial(const Pose2& T_map_robot, const Measurement& measurement);

  [[nodiscard]] Innovation<3> GateInnovation(const Pose2& T_map_robot, const Measurement& measurement) const;
  template <typename Fuse>
  void ForEachInnovation(const Pose2& T_map_robot, const Measurement& measurement, const Fuse& fuse) const {
    fuse(GateInnovation(T_map_robot, measurement));
  }
  void Learn(const Pose2& T_map_robot, const Measurement& measurement);
  void Move(const Pose2& correction);

  [[nodiscard]] Eigen::Vector2d p_map() const { return mean.head<2>(); }
  [[nodiscard]] double slope() const { return mean.z(); }
  [[nodiscard]] Eigen::Matrix2d covariance() const { return P.topLeftCorner<2, 2>(); }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.mean, self.P);
  }
};

}  // namespace cairn::slam
