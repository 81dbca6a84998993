// A landmark as two positions, filtered one by one: the feature itself and a virtual point a metre along its slope, so
// that seeing it again also tells the heading (FS_2LS_2LP). Frame `map`; the pose it was seen from is taken as known,
// as each particle does. Plain values.
// Source: thesis A 4.4-4.6, Tables 4.3-4.7. Corrected: the bearing of Table 4.3 subtracts the slope where the heading
// belongs; Table 4.7 writes xf for pf in the gain; Gz (4-15) is the Jacobian with respect to the measurement.
// Noise put right: both points come from one feature, so their errors are the same error seen twice, and filtering them
// as if independent counts it twice. Each gets its own covariance (the extension's with the slope's noise) doubled:
// covariance intersection with equal shares (Julier and Uhlmann 1997), which never claims too much.
#pragma once

#include <Eigen/Core>

#include "server/slam/filters/innovation.h"
#include "server/slam/filters/landmark_sighting.h"

namespace cairn::slam {

struct LandmarkPosition {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();        // xf
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  // pf
};

// Expected range and bearing of a position against a measured one.
[[nodiscard]] Innovation<2> Innovate(const LandmarkPosition& position, const Pose2& T_map_robot,
                                     const Eigen::Vector2d& z, const Eigen::Matrix2d& R_z);
// The same landmark after the frame it was mapped in moved by `correction`.
[[nodiscard]] LandmarkPosition Moved(const LandmarkPosition& position, const Pose2& correction);
// (4-13), (4-14).
[[nodiscard]] LandmarkPosition PositionAt(const Pose2& T_map_robot, const Eigen::Vector2d& z,
                                          const Eigen::Matrix2d& R_z);
// Table 4.7.
void Update(LandmarkPosition& position, const Pose2& T_map_robot, const Eigen::Vector2d& z, const Eigen::Matrix2d& R_z);

struct LandmarkPair {
  LandmarkPosition position;
  LandmarkPosition extension;

  struct Measurement {
    Eigen::Vector2d z_position, z_extension;
    Eigen::Matrix2d R_position, R_extension;
  };
  static constexpr int kNumbers = 4;
  static constexpr int kGateNumbers = 2;  // The gate looks at the position; the slope has a gate of its own.

  [[nodiscard]] static Measurement Measure(const LandmarkSighting& sighting, const LandmarkNoise& noise);
  // Log density a measurement has at squared distance `nis` from a landmark as uncertain as the measurement.
  [[nodiscard]] static double LogDensityAt(double nis, const Measurement& measurement);
  [[nodiscard]] static LandmarkPair Initial(const Pose2& T_map_robot, const Measurement& measurement);

  [[nodiscard]] Innovation<2> GateInnovation(const Pose2& T_map_robot, const Measurement& measurement) const {
    return Innovate(position, T_map_robot, measurement.z_position, measurement.R_position);
  }
  // Hands every innovation to `fuse`, which may change T_map_robot: the next one is taken from where it then is.
  template <typename Fuse>
  void ForEachInnovation(const Pose2& T_map_robot, const Measurement& measurement, const Fuse& fuse) const {
    fuse(Innovate(position, T_map_robot, measurement.z_position, measurement.R_position));
    fuse(Innovate(extension, T_map_robot, measurement.z_extension, measurement.R_extension));
  }
  void Learn(const Pose2& T_map_robot, const Measurement& measurement);
  void Move(const Pose2& correction) {
    position = Moved(position, correction);
    extension = Moved(extension, correction);
  }

  [[nodiscard]] const Eigen::Vector2d& p_map() const { return position.mean; }
  [[nodiscard]] double slope() const;
  [[nodiscard]] Eigen::Matrix2d covariance() const { return position.covariance; }
};

}  // namespace cairn::slam
