// The type of each message on the wire: its type support, and the hash that ROS 2 from Iron on puts into the user data
// of endpoints (REP 2011: RIHS01, the SHA-256 of the type's description). tests/idl/type_hash_test.py computes the
// hashes again from idl/ros2. This header includes generated code; include it only inside common/wire and tests.
#pragma once

#include "common/ros2/messages.h"
#include "common/wire/sample_type.h"
#include "ros2/geometry_msgsPubSubTypes.h"
#include "ros2/map_msgsPubSubTypes.h"
#include "ros2/nav_msgsPubSubTypes.h"
#include "ros2/sensor_msgsPubSubTypes.h"
#include "ros2/tf2_msgsPubSubTypes.h"

namespace cairn::ros2 {

template <typename Message>
struct MessageType;

template <>
struct MessageType<LaserScan> {
  using Wire = ::sensor_msgs::msg::dds_::LaserScan_;
  using Type = wire::SampleType<Wire, ::sensor_msgs::msg::dds_::LaserScan_PubSubType>;
  static constexpr const char* kHash = "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828";
};
template <>
struct MessageType<Odometry> {
  using Wire = ::nav_msgs::msg::dds_::Odometry_;
  using Type = wire::SampleType<Wire, ::nav_msgs::msg::dds_::Odometry_PubSubType>;
  static constexpr const char* kHash = "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0";
};
template <>
struct MessageType<Transforms> {
  using Wire = ::tf2_msgs::msg::dds_::TFMessage_;
  using Type = wire::SampleType<Wire, ::tf2_msgs::msg::dds_::TFMessage_PubSubType>;
  static constexpr const char* kHash = "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
};
template <>
struct MessageType<PoseWithCovariance> {
  using Wire = ::geometry_msgs::msg::dds_::PoseWithCovarianceStamped_;
  using Type = wire::SampleType<Wire, ::geometry_msgs::msg::dds_::PoseWithCovarianceStamped_PubSubType>;
  static constexpr const char* kHash = "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e";
};
template <>
struct MessageType<Grid> {
  using Wire = ::nav_msgs::msg::dds_::OccupancyGrid_;
  using Type = wire::SampleType<Wire, ::nav_msgs::msg::dds_::OccupancyGrid_PubSubType>;
  static constexpr const char* kHash = "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7";
};
template <>
struct MessageType<GridUpdate> {
  using Wire = ::map_msgs::msg::dds_::OccupancyGridUpdate_;
  using Type = wire::SampleType<Wire, ::map_msgs::msg::dds_::OccupancyGridUpdate_PubSubType>;
  static constexpr const char* kHash = "c4095b0be2e4363f8978a1570e0293ee093436f1e1c61d99b48502ac317025e8";
};

}  // namespace cairn::ros2
