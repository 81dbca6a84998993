// The messages of a robot's drive from the bytes of a bag, in the encoding that their topic names: CDR of ROS 2, or
// Protobuf of Foxglove's. REQUIRES: a topic that ChooseTopics returns. Stateless, thread-safe.
#pragma once

#include <string_view>

#include "common/bag/bag_file.h"
#include "common/bag/foxglove_decoding.h"
#include "common/ros2/messages.h"
#include "common/status.h"

namespace cairn::bag {

[[nodiscard]] Result<ScanMessage> DecodeScan(const Topic& topic, std::string_view bytes);
// The child's frame is empty where the message does not name it.
[[nodiscard]] Result<ros2::Odometry> DecodeOdometry(const Topic& topic, std::string_view bytes);
[[nodiscard]] Result<ros2::Transforms> DecodeTransforms(const Topic& topic, std::string_view bytes);

}  // namespace cairn::bag
