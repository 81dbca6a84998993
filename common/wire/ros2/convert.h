// Converts messages to the types of idl/ros2 and back. FromWire fails for what exceeds the limits of message_checks.h,
// and where the nanoseconds of a stamp are no part of a second. This header includes generated code; include it only
// inside common/wire and tests.
#pragma once

#include "common/ros2/messages.h"
#include "common/status.h"
#include "ros2/geometry_msgs.h"
#include "ros2/map_msgs.h"
#include "ros2/nav_msgs.h"
#include "ros2/sensor_msgs.h"
#include "ros2/tf2_msgs.h"

namespace cairn::ros2 {

[[nodiscard]] Result<LaserScan> FromWire(::sensor_msgs::msg::dds_::LaserScan_&& wire);
[[nodiscard]] Result<Odometry> FromWire(::nav_msgs::msg::dds_::Odometry_&& wire);
[[nodiscard]] Result<Transforms> FromWire(::tf2_msgs::msg::dds_::TFMessage_&& wire);
[[nodiscard]] Result<PoseWithCovariance> FromWire(::geometry_msgs::msg::dds_::PoseWithCovarianceStamped_&& wire);

[[nodiscard]] ::sensor_msgs::msg::dds_::LaserScan_ ToWire(const LaserScan& value);
[[nodiscard]] ::nav_msgs::msg::dds_::Odometry_ ToWire(const Odometry& value);
[[nodiscard]] ::tf2_msgs::msg::dds_::TFMessage_ ToWire(const Transforms& value);
[[nodiscard]] ::geometry_msgs::msg::dds_::PoseWithCovarianceStamped_ ToWire(const PoseWithCovariance& value);
[[nodiscard]] ::nav_msgs::msg::dds_::OccupancyGrid_ ToWire(const Grid& value);
[[nodiscard]] ::map_msgs::msg::dds_::OccupancyGridUpdate_ ToWire(const GridUpdate& value);

}  // namespace cairn::ros2
