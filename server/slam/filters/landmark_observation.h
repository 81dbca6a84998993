// A landmark as one scan shows it, and how precisely: range and bearing of the feature and of its extension point a
// metre along its slope.
// Source: thesis A 4.4, Table 4.3 (whose bearing subtracts the slope where the heading belongs).
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct LandmarkObservation {
  std::size_t id = 0;                                 // Landmark it shows, from data association.
  bool known = false;                                 // False: a new landmark; id is the next free one.
  Eigen::Vector2d p_robot = Eigen::Vector2d::Zero();  // Corner, or midpoint of a line ended on both sides.
  double slope = 0.0;                                 // Direction of its (first) line, in robot.
  [[nodiscard]] Eigen::Vector2d extension_robot() const {
    return p_robot + Eigen::Vector2d(std::cos(slope), std::sin(slope));
  }
};

struct LandmarkNoise {
  double range_m = 0.10;      // Standard deviation of a landmark's range.
  double bearing_rad = 0.03;  // ... and bearing.
  [[nodiscard]] Eigen::Matrix2d R_z() const {
    return Eigen::Vector2d(range_m * range_m, bearing_rad * bearing_rad).asDiagonal();
  }
};

// Range and bearing of a point from the robot, (4-16), with Jacobians (4-17), (4-18).
struct RangeBearing {
  Eigen::Vector2d z;                     // Range, bearing wrapped.
  Eigen::Matrix<double, 2, 3> J_z_pose;  // Hv
  Eigen::Matrix2d J_z_point;             // Hf
};
[[nodiscard]] RangeBearing PredictRangeBearing(const Pose2& T_map_robot, const Eigen::Vector2d& p_map);

// Range and bearing of a point in the robot frame.
[[nodiscard]] Eigen::Vector2d MeasureRangeBearing(const Eigen::Vector2d& p_robot);

}  // namespace cairn::slam
