// Messages of Foxglove's and of our own (foxglove_encoding.h) as values, from any file. Stamps, names, counts and
// quaternions of what is returned have been checked as those of ROS 2 (ros2/message_checks.h); numbers may be anything.
// Errors: kInvalidArgument for bytes that are no such message, kOutOfRange for what is in them. Stateless, thread-safe.
#pragma once

#include <string_view>

#include "common/ros2/messages.h"
#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"
#include "common/status.h"

namespace cairn::bag {

// A scan and where its plane lies in the frame of its header.
struct ScanMessage {
  ros2::LaserScan scan;
  ros2::Pose3 T_frame_scan = {};
};
// Foxglove's scan has no limits of the range and no times of its beams: they are 0, and range_max is that of logs that
// do not say it (80 m).
[[nodiscard]] Result<ScanMessage> DecodeFoxgloveScan(std::string_view bytes);

// The child's frame is not named.
[[nodiscard]] Result<ros2::Odometry> DecodePoseInFrame(std::string_view bytes);
[[nodiscard]] Result<ros2::Transforms> DecodeFrameTransform(std::string_view bytes);
[[nodiscard]] Result<ros2::Transforms> DecodeFrameTransforms(std::string_view bytes);

// A scan without its ranges. The mounting is finite.
[[nodiscard]] Result<Scan> DecodeScanDetails(std::string_view bytes);
// The pose is finite.
[[nodiscard]] Result<Odometry> DecodeOdometryDetails(std::string_view bytes);

}  // namespace cairn::bag
