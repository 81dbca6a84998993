// Converts requests and answers of services, as convert.h converts messages. FromWire fails for a text that is longer
// than kMaxServiceText. This header includes generated code; include it only inside common/wire and tests.
#pragma once

#include <cstddef>

#include "common/ros2/services.h"
#include "common/status.h"
#include "ros2/nav_msgs.h"
#include "ros2/slam_toolbox.h"

namespace cairn::ros2 {

inline constexpr std::size_t kMaxServiceText = 1024;

[[nodiscard]] Result<LoadMap::Request> FromWire(::nav_msgs::srv::dds_::LoadMap_Request_&& wire);
[[nodiscard]] Result<SaveMap::Request> FromWire(::slam_toolbox::srv::dds_::SaveMap_Request_&& wire);
[[nodiscard]] Result<SerializePoseGraph::Request> FromWire(
    ::slam_toolbox::srv::dds_::SerializePoseGraph_Request_&& wire);
[[nodiscard]] Result<Reset::Request> FromWire(::slam_toolbox::srv::dds_::Reset_Request_&& wire);

[[nodiscard]] ::nav_msgs::srv::dds_::GetMap_Response_ ToWire(const GetMap::Response& value);
[[nodiscard]] ::nav_msgs::srv::dds_::LoadMap_Response_ ToWire(const LoadMap::Response& value);
[[nodiscard]] ::slam_toolbox::srv::dds_::SaveMap_Response_ ToWire(const SaveMap::Response& value);
[[nodiscard]] ::slam_toolbox::srv::dds_::SerializePoseGraph_Response_ ToWire(const SerializePoseGraph::Response& value);
[[nodiscard]] ::slam_toolbox::srv::dds_::Pause_Response_ ToWire(const Pause::Response& value);
[[nodiscard]] ::slam_toolbox::srv::dds_::Reset_Response_ ToWire(const Reset::Response& value);

}  // namespace cairn::ros2
