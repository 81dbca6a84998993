// The types of each service on the wire: those of idl/ros2 with their type supports, and their hashes, as
// message_types.h has them for messages. This header includes generated code; include it only inside common/wire and
// tests.
#pragma once

#include "common/ros2/services.h"
#include "ros2/nav_msgsPubSubTypes.h"
#include "ros2/slam_toolboxPubSubTypes.h"

namespace cairn::ros2 {

template <typename S>
struct ServiceType;

template <>
struct ServiceType<GetMap> {
  using RequestWire = ::nav_msgs::srv::dds_::GetMap_Request_;
  using RequestType = ::nav_msgs::srv::dds_::GetMap_Request_PubSubType;
  static constexpr const char* kRequestHash = "b531e302f1bd6a81f8a5e03453266c378b1f711b4296000c1c0f53a40e00a7c4";
  using ResponseWire = ::nav_msgs::srv::dds_::GetMap_Response_;
  using ResponseType = ::nav_msgs::srv::dds_::GetMap_Response_PubSubType;
  static constexpr const char* kResponseHash = "45246f7a2ff0cbfa46e13865d4b95929ebb6d2846d1b85a20ad51030f4690dc2";
};
template <>
struct ServiceType<LoadMap> {
  using RequestWire = ::nav_msgs::srv::dds_::LoadMap_Request_;
  using RequestType = ::nav_msgs::srv::dds_::LoadMap_Request_PubSubType;
  static constexpr const char* kRequestHash = "0f8fe3aac433c977d7c2f8b57ab1c3a17677e24880d76919b69e4208e99f5132";
  using ResponseWire = ::nav_msgs::srv::dds_::LoadMap_Response_;
  using ResponseType = ::nav_msgs::srv::dds_::LoadMap_Response_PubSubType;
  static constexpr const char* kResponseHash = "e7970ddf9f58e10d34b5eae6d2baca31b2b3e2f2fe6d082b3aae2a5f92777b2a";
};
template <>
struct ServiceType<SaveMap> {
  using RequestWire = ::slam_toolbox::srv::dds_::SaveMap_Request_;
  using RequestType = ::slam_toolbox::srv::dds_::SaveMap_Request_PubSubType;
  static constexpr const char* kRequestHash = "53030f29f705b5f868bf35ce8a5bdd5a9b17f670649396fdbbc4a8dbe7ad0973";
  using ResponseWire = ::slam_toolbox::srv::dds_::SaveMap_Response_;
  using ResponseType = ::slam_toolbox::srv::dds_::SaveMap_Response_PubSubType;
  static constexpr const char* kResponseHash = "713758aaa982f631420bcd79707de16f6729ecd6ba855070267104bdcdee6b22";
};
template <>
struct ServiceType<SerializePoseGraph> {
  using RequestWire = ::slam_toolbox::srv::dds_::SerializePoseGraph_Request_;
  using RequestType = ::slam_toolbox::srv::dds_::SerializePoseGraph_Request_PubSubType;
  static constexpr const char* kRequestHash = "723d3bfb9150b866fcbb26e447c8c7af3fb1e77e14d684037dc2baa0dbe80bd6";
  using ResponseWire = ::slam_toolbox::srv::dds_::SerializePoseGraph_Response_;
  using ResponseType = ::slam_toolbox::srv::dds_::SerializePoseGraph_Response_PubSubType;
  static constexpr const char* kResponseHash = "89b3b7194fed12911fd6e44bdfac000ad6a5b3ef1dda9b11f71481388cde49ec";
};
template <>
struct ServiceType<Pause> {
  using RequestWire = ::slam_toolbox::srv::dds_::Pause_Request_;
  using RequestType = ::slam_toolbox::srv::dds_::Pause_Request_PubSubType;
  static constexpr const char* kRequestHash = "bd94128b2476065d43caa26f43334ad5b688186e82ca73366f11e6459b7562a6";
  using ResponseWire = ::slam_toolbox::srv::dds_::Pause_Response_;
  using ResponseType = ::slam_toolbox::srv::dds_::Pause_Response_PubSubType;
  static constexpr const char* kResponseHash = "72bc942536d6fb903377dbf48c7c2e0c965cb2b04f508477d9c8aced687d6d94";
};
template <>
struct ServiceType<Reset> {
  using RequestWire = ::slam_toolbox::srv::dds_::Reset_Request_;
  using RequestType = ::slam_toolbox::srv::dds_::Reset_Request_PubSubType;
  static constexpr const char* kRequestHash = "e3eb332dcfed05e39e67aa244c229e5a4d1741969d26e0d8f9138425ee4f8856";
  using ResponseWire = ::slam_toolbox::srv::dds_::Reset_Response_;
  using ResponseType = ::slam_toolbox::srv::dds_::Reset_Response_PubSubType;
  static constexpr const char* kResponseHash = "46ca8b03f861d70ebb5a9be4d4eab4cd00119d209ad9ee01e93f4690140dceae";
};

}  // namespace cairn::ros2
