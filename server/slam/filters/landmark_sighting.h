// A stable feature as one scan shows it, before anybody has said which landmark it is; and how range and bearing of a
// point follow from a pose. Frames: `robot` and `map`. Stateless.
// Source: thesis A 4.4, (4-16)-(4-18); Table 4.5.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>

#include "common/geometry/pose2.h"
#include "server/slam/filters/landmark_options.h"

namespace cairn::slam {

// What does not change with the robot's pose.
struct LandmarkSignature {
  bool corner = false;
  double shape = 0.0;  // Corner: signed angle between its lines, rad. Line: length, m.
};

// Of the same kind, with angle or length within `same_angle_rad`, `same_length_m`.
[[nodiscard]] bool Alike(const LandmarkSignature& a, const LandmarkSignature& b, const LandmarkOptions& options);

struct LandmarkSighting {
  std::size_t slot = 0;  // Of the candidate it belongs to: where the landmark is kept by those who find it new.
  LandmarkSignature signature;
  Eigen::Vector2d p_robot = Eigen::Vector2d::Zero();  // Corner, or midpoint of a line ended on both sides.
  double slope = 0.0;                                 // Direction of its (first) line, in robot.
  [[nodiscard]] Eigen::Vector2d extension_robot() const {
    return p_robot + Eigen::Vector2d(std::cos(slope), std::sin(slope));
  }
};

// Whether the slopes of the lines on both sides are within `match_slope_rad` of the landmark's (4.4).
[[nodiscard]] bool SlopesAgree(const LandmarkSighting& sighting, double robot_heading, double landmark_slope,
                               const LandmarkSignature& landmark, const LandmarkOptions& options);

// Range and bearing of a point from the robot, (4-16), with Jacobians (4-17), (4-18).
struct RangeBearing {
  Eigen::Vector2d z;                     // Range, bearing wrapped.
  Eigen::Matrix<double, 2, 3> J_z_pose;  // Hv
  Eigen::Matrix2d J_z_point;             // Hf
};
[[nodiscard]] RangeBearing PredictRangeBearing(const Pose2& T_map_robot, const Eigen::Vector2d& p_map);

// Range and bearing of a point in the robot frame.
[[nodiscard]] Eigen::Vector2d MeasureRangeBearing(const Eigen::Vector2d& p_robot);

// d(point in map) / d(range, bearing): Gz, the Jacobian with respect to the measurement. (4-15) names the vehicle's
// states instead.
[[nodiscard]] Eigen::Matrix2d J_point_z(const Pose2& T_map_robot, const Eigen::Vector2d& z);

}  // namespace cairn::slam
