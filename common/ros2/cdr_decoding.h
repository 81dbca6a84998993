// Messages of ROS 2 from the bytes of a bag. The checks are those of messages from the wire (message_checks.h); numbers
// may be anything, also NaN. Fields behind those that Cairn uses are not looked at. Stateless, thread-safe.
#pragma once

#include <string_view>

#include "common/ros2/messages.h"
#include "common/status.h"

namespace cairn::ros2 {

[[nodiscard]] Result<LaserScan> DecodeLaserScan(std::string_view bytes);    // sensor_msgs/msg/LaserScan
[[nodiscard]] Result<Odometry> DecodeOdometry(std::string_view bytes);      // nav_msgs/msg/Odometry
[[nodiscard]] Result<Transforms> DecodeTransforms(std::string_view bytes);  // tf2_msgs/msg/TFMessage

}  // namespace cairn::ros2
