#include "common/wire/ros2/convert_services.h"

#include <string>
#include <utility>

#include "common/wire/ros2/convert.h"

namespace cairn::ros2 {
namespace {

Result<std::string> Text(std::string&& text) {
  if (text.size() > kMaxServiceText) return Fail(StatusCode::kOutOfRange, "a text is too long");
  return std::move(text);
}

}  // namespace

Result<LoadMap::Request> FromWire(::nav_msgs::srv::dds_::LoadMap_Request_&& wire) {
  return Text(std::move(wire.map_url())).map([](std::string&& text) { return LoadMap::Request{std::move(text)}; });
}

Result<SaveMap::Request> FromWire(::slam_toolbox::srv::dds_::SaveMap_Request_&& wire) {
  return Text(std::move(wire.name().data())).map([](std::string&& text) { return SaveMap::Request{std::move(text)}; });
}

Result<SerializePoseGraph::Request> FromWire(::slam_toolbox::srv::dds_::SerializePoseGraph_Request_&& wire) {
  return Text(std::move(wire.filename())).map([](std::string&& text) {
    return SerializePoseGraph::Request{std::move(text)};
  });
}

Result<Reset::Request> FromWire(::slam_toolbox::srv::dds_::Reset_Request_&& wire) {
  return Reset::Request{wire.pause_new_measurements()};
}

::nav_msgs::srv::dds_::GetMap_Response_ ToWire(const GetMap::Response& value) {
  ::nav_msgs::srv::dds_::GetMap_Response_ wire;
  wire.map(ToWire(value.map));
  return wire;
}

::nav_msgs::srv::dds_::LoadMap_Response_ ToWire(const LoadMap::Response& value) {
  ::nav_msgs::srv::dds_::LoadMap_Response_ wire;
  wire.map(ToWire(value.map));
  wire.result(value.result);
  return wire;
}

::slam_toolbox::srv::dds_::SaveMap_Response_ ToWire(const SaveMap::Response& value) {
  ::slam_toolbox::srv::dds_::SaveMap_Response_ wire;
  wire.result(value.result);
  return wire;
}

::slam_toolbox::srv::dds_::SerializePoseGraph_Response_ ToWire(const SerializePoseGraph::Response& value) {
  ::slam_toolbox::srv::dds_::SerializePoseGraph_Response_ wire;
  wire.result(value.result);
  return wire;
}

::slam_toolbox::srv::dds_::Pause_Response_ ToWire(const Pause::Response& value) {
  ::slam_toolbox::srv::dds_::Pause_Response_ wire;
  wire.status(value.status);
  return wire;
}

::slam_toolbox::srv::dds_::Reset_Response_ ToWire(const Reset::Response& value) {
  ::slam_toolbox::srv::dds_::Reset_Response_ wire;
  wire.result(value.result);
  return wire;
}

}  // namespace cairn::ros2
