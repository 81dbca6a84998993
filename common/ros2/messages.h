// The messages of ROS 2 that Cairn reads and writes, as plain values. Units are those of ROS: metres, radians, seconds.
// Only lengths and stamps have been checked when one arrives (message_checks.h); numbers may be anything, also NaN.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/stamp.h"

namespace cairn::ros2 {

struct Header {
  Stamp stamp = 0;
  std::string frame;  // Without a slash in front.
};

// T_a_b in space.
struct Pose3 {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
};

struct LaserScan {
  Header header;  // The stamp is the time of the first ray.
  double angle_min = 0.0;
  double angle_increment = 0.0;
  double time_increment = 0.0;  // Between two rays.
  double scan_time = 0.0;       // Between two scans.
  double range_min = 0.0;
  double range_max = 0.0;
  std::vector<float> ranges;
};

struct Odometry {
  Header header;            // The frame is that in which the pose is, mostly "odom".
  std::string child_frame;  // The frame of the robot.
  Pose3 pose;
};

struct Transform {
  Header header;
  std::string child_frame;
  Pose3 T_frame_child;
};
struct Transforms {
  std::vector<Transform> transforms;
};

struct PoseWithCovariance {
  Header header;
  Pose3 pose;
  std::array<double, 36> covariance{};  // Of x, y, z and the turns about these axes, row by row.
};

// Cells are 0 (free) .. 100 (occupied), or -1 (unknown), row by row from the lowest y.
struct Grid {
  Header header;
  Stamp loaded = 0;
  double resolution = 0.0;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  Pose2 T_frame_origin;  // The lower left corner of cell (0, 0).
  std::vector<std::int8_t> cells;
};

// A rectangle of the grid that was published last, at cell (x, y).
struct GridUpdate {
  Header header;
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::vector<std::int8_t> cells;
};

}  // namespace cairn::ros2
