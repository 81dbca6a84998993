// A landmark as two positions that are filtered separately: the feature itself, and a virtual point one metre
// away along its slope, so that seeing the landmark again also measures the heading (FS_2LS_2LP). Frame
// `map`. The pose from which it was seen counts as known, as it does for each particle. Plain values.
// Source: thesis A 4.4-4.6, Tables 4.3-4.7. Corrected: the bearing of Table 4.3 subtracts the slope instead
// of the heading; Table 4.7 has xf instead of pf in the gain; Gz (4-15) is the Jacobian with respect to the
// measurement.
// The noise is corrected, too: both points come from one feature and share its error, which would count twice
// if they were filtered as independent. Each therefore has its own covariance (that of the extension includes
// the noise of the slope), doubled. This is covariance intersection with equal shares (Julier and Uhlmann
// 1997), which is never overconfident.
#pragma once

#include <Eigen/Core>

#include "server/slam/landmarks/innovation.h"
#include "server/slam/landmarks/landmark_sighting.h"

namespace cairn::slam {

struct LandmarkPosition {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();        // Position in `map`; xf in the thesis.
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  // Covariance in `map`; pf in the thesis.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.mean, self.covariance);
  }
};

// The innovation of a measured range and bearing `z` against those that are expected for a position.
[[nodiscard]] Innovation<2> Innovate(const LandmarkPosition& position, const Pose2& T_map_robot,
                                     const Eigen::Vector2d& z, const Eigen::Matrix2d& R_z);
// The position after the frame in which it was mapped has moved by `correction`.
[[nodiscard]] LandmarkPosition Moved(const LandmarkPosition& position, const Pose2& correction);
// The position of a new landmark from its first measurement, (4-13), (4-14).
[[nodiscard]] LandmarkPosition PositionAt(const Pose2& T_map_robot, const Eigen::Vector2d& z,
                                          const Eigen::Matrix2d& R_z);
// Updates a position with one measurement, Table 4.7.
void Update(LandmarkPosition& position, const Pose2& T_map_robot, const Eigen::Vector2d& z, const Eigen::Matrix2d& R_z);

struct LandmarkPair {
  LandmarkPosition position;
  LandmarkPosition extension;

  struct Measurement {
    Eigen::Vector2d z_position, z_extension;
    Eigen::Matrix2d R_position, R_extension;
  };
  static constexpr int kNumbers = 4;
  static constexpr int kGateNumbers = 2;  // The gate uses the position only; the slope has a gate of its own.

  [[nodiscard]] static Measurement Measure(const LandmarkSighting& sighting, const LandmarkNoise& noise);
  // Log density of a measurement at the squared Mahalanobis distance `nis` from a landmark that is as
  // uncertain as the measurement.
  [[nodiscard]] static double LogDensityAt(double nis, const Measurement& measurement);
  [[nodiscard]] static LandmarkPair Initial(const Pose2& T_map_robot, const Measurement& measurement);

  [[nodiscard]] Innovation<2> GateInnovation(const Pose2& T_map_robot, const Measurement& measurement) const {
    return Innovate(position, T_map_robot, measurement.z_position, measurement.R_position);
  }
  // Calls `fuse` with every innovation. `fuse` may change T_map_robot; the next innovation is computed at the
  // changed pose.
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

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.position, self.extension);
  }
};

}  // namespace cairn::slam
