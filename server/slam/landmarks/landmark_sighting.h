// A stable feature as one scan shows it, not yet associated with a landmark; and the range and bearing of a
// point that follow from a pose. Frames: `robot` and `map`. Stateless.
// Source: thesis A 4.4, (4-16)-(4-18); Table 4.5.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>

#include "common/geometry/pose2.h"
#include "server/slam/landmarks/landmark_options.h"

namespace cairn::slam {

// The properties of a feature that do not depend on the pose of the robot.
struct LandmarkSignature {
  bool corner = false;
  double shape = 0.0;  // Corner: signed angle between its lines, rad. Line: length, m.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.corner, self.shape);
  }
};

// True if both are of the same kind, and their angles differ by less than `same_angle_rad` or their lengths
// by less than `same_length_m`.
[[nodiscard]] bool Alike(const LandmarkSignature& a, const LandmarkSignature& b, const LandmarkOptions& options);

struct LandmarkSighting {
  std::size_t slot = 0;  // Slot of its candidate. A particle to which it is new stores the landmark there.
  LandmarkSignature signature;
  Eigen::Vector2d p_robot = Eigen::Vector2d::Zero();  // Corner, or midpoint of a line ended on both sides.
  double slope = 0.0;                                 // Direction of its (first) line, in robot.
  [[nodiscard]] Eigen::Vector2d extension_robot() const {
    return p_robot + Eigen::Vector2d(std::cos(slope), std::sin(slope));
  }
};

// True if the slopes of the lines on both sides differ by at most `match_slope_rad` from those of the
// landmark (4.4).
[[nodiscard]] bool SlopesAgree(const LandmarkSighting& sighting, double robot_heading, double landmark_slope,
                               const LandmarkSignature& landmark, const LandmarkOptions& options);

// Range and bearing of a point from the robot, (4-16), with Jacobians (4-17), (4-18).
struct RangeBearing {
  Eigen::Vector2d z;                     // Range, bearing wrapped.
  Eigen::Matrix<double, 2, 3> J_z_pose;  // Hv in the thesis.
  Eigen::Matrix2d J_z_point;             // Hf in the thesis.
};
[[nodiscard]] RangeBearing PredictRangeBearing(const Pose2& T_map_robot, const Eigen::Vector2d& p_map);

// Range and bearing of a point in the robot frame.
[[nodiscard]] Eigen::Vector2d MeasureRangeBearing(const Eigen::Vector2d& p_robot);

// Derivative of the point in `map` with respect to (range, bearing): Gz. Corrected: (4-15) names the states
// of the vehicle instead of the measurement.
[[nodiscard]] Eigen::Matrix2d J_point_z(const Pose2& T_map_robot, const Eigen::Vector2d& z);

}  // namespace cairn::slam
