#include "common/wire/ros2/convert.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/ros2/message_checks.h"

namespace cairn::ros2 {
namespace {

namespace builtin = ::builtin_interfaces::msg::dds_;
namespace std_msgs = ::std_msgs::msg::dds_;
namespace geometry = ::geometry_msgs::msg::dds_;

Result<Header> FromWire(std_msgs::Header_&& wire) {
  auto frame = FrameName(std::move(wire.frame_id()));
  if (!frame) return tl::unexpected(frame.error());
  const auto stamp = StampOfTime(wire.stamp().sec(), wire.stamp().nanosec());
  if (!stamp) return tl::unexpected(stamp.error());
  return Header{*stamp, *std::move(frame)};
}

// The stamps of ROS have 32 bits for the seconds: they end in 2038.
builtin::Time_ TimeOf(Stamp stamp) {
  Stamp seconds = stamp / kNanosPerSecond, nanoseconds = stamp % kNanosPerSecond;
  if (nanoseconds < 0) {
    nanoseconds += kNanosPerSecond;
    --seconds;
  }
  builtin::Time_ wire;
  wire.sec(static_cast<std::int32_t>(
      std::clamp<Stamp>(seconds, std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max())));
  wire.nanosec(static_cast<std::uint32_t>(nanoseconds));
  return wire;
}

std_msgs::Header_ ToWire(const Header& value) {
  std_msgs::Header_ wire;
  wire.stamp(TimeOf(value.stamp));
  wire.frame_id(value.frame);
  return wire;
}

Eigen::Quaterniond FromWire(const geometry::Quaternion_& wire) {
  return {wire.w(), wire.x(), wire.y(), wire.z()};
}

geometry::Quaternion_ ToWire(const Eigen::Quaterniond& value) {
  geometry::Quaternion_ wire;
  wire.x(value.x());
  wire.y(value.y());
  wire.z(value.z());
  wire.w(value.w());
  return wire;
}

Pose3 FromWire(const geometry::Pose_& wire) {
  return {{wire.position().x(), wire.position().y(), wire.position().z()}, FromWire(wire.orientation())};
}

geometry::Pose_ ToWire(const Pose3& value) {
  geometry::Pose_ wire;
  wire.position().x(value.translation.x());
  wire.position().y(value.translation.y());
  wire.position().z(value.translation.z());
  wire.orientation(ToWire(value.rotation));
  return wire;
}

geometry::Pose_ ToWire(const Pose2& value) {
  return ToWire(
      Pose3{{value.x, value.y, 0.0}, Eigen::Quaterniond(Eigen::AngleAxisd(value.theta, Eigen::Vector3d::UnitZ()))});
}

}  // namespace

Result<LaserScan> FromWire(::sensor_msgs::msg::dds_::LaserScan_&& wire) {
  Result<Header> header = FromWire(std::move(wire.header()));
  if (!header) return tl::unexpected(header.error());
  if (wire.ranges().size() > kMaxRanges) return Fail(StatusCode::kOutOfRange, "a scan has too many ranges");
  LaserScan value;
  value.header = *std::move(header);
  value.angle_min = wire.angle_min();
  value.angle_increment = wire.angle_increment();
  value.time_increment = wire.time_increment();
  value.scan_time = wire.scan_time();
  value.range_min = wire.range_min();
  value.range_max = wire.range_max();
  value.ranges = std::move(wire.ranges());
  return value;
}

Result<Odometry> FromWire(::nav_msgs::msg::dds_::Odometry_&& wire) {
  Result<Header> header = FromWire(std::move(wire.header()));
  if (!header) return tl::unexpected(header.error());
  auto child = FrameName(std::move(wire.child_frame_id()));
  if (!child) return tl::unexpected(child.error());
  return Odometry{*std::move(header), *std::move(child), FromWire(wire.pose().pose())};
}

Result<Transforms> FromWire(::tf2_msgs::msg::dds_::TFMessage_&& wire) {
  if (wire.transforms().size() > kMaxTransforms) return Fail(StatusCode::kOutOfRange, "too many transforms");
  Transforms value;
  for (geometry::TransformStamped_& one : wire.transforms()) {
    Result<Header> header = FromWire(std::move(one.header()));
    if (!header) return tl::unexpected(header.error());
    auto child = FrameName(std::move(one.child_frame_id()));
    if (!child) return tl::unexpected(child.error());
    const geometry::Vector3_& at = one.transform().translation();
    value.transforms.push_back(
        {*std::move(header), *std::move(child), {{at.x(), at.y(), at.z()}, FromWire(one.transform().rotation())}});
  }
  return value;
}

Result<PoseWithCovariance> FromWire(::geometry_msgs::msg::dds_::PoseWithCovarianceStamped_&& wire) {
  Result<Header> header = FromWire(std::move(wire.header()));
  if (!header) return tl::unexpected(header.error());
  return PoseWithCovariance{*std::move(header), FromWire(wire.pose().pose()), wire.pose().covariance()};
}

::sensor_msgs::msg::dds_::LaserScan_ ToWire(const LaserScan& value) {
  ::sensor_msgs::msg::dds_::LaserScan_ wire;
  wire.header(ToWire(value.header));
  wire.angle_min(static_cast<float>(value.angle_min));
  const double last = value.ranges.empty() ? 0.0 : static_cast<double>(value.ranges.size() - 1);
  wire.angle_max(static_cast<float>(value.angle_min + value.angle_increment * last));
  wire.angle_increment(static_cast<float>(value.angle_increment));
  wire.time_increment(static_cast<float>(value.time_increment));
  wire.scan_time(static_cast<float>(value.scan_time));
  wire.range_min(static_cast<float>(value.range_min));
  wire.range_max(static_cast<float>(value.range_max));
  wire.ranges(value.ranges);
  return wire;
}

::nav_msgs::msg::dds_::Odometry_ ToWire(const Odometry& value) {
  ::nav_msgs::msg::dds_::Odometry_ wire;
  wire.header(ToWire(value.header));
  wire.child_frame_id(value.child_frame);
  wire.pose().pose(ToWire(value.pose));
  return wire;
}

::tf2_msgs::msg::dds_::TFMessage_ ToWire(const Transforms& value) {
  ::tf2_msgs::msg::dds_::TFMessage_ wire;
  for (const Transform& one : value.transforms) {
    geometry::TransformStamped_ transform;
    transform.header(ToWire(one.header));
    transform.child_frame_id(one.child_frame);
    transform.transform().translation().x(one.T_frame_child.translation.x());
    transform.transform().translation().y(one.T_frame_child.translation.y());
    transform.transform().translation().z(one.T_frame_child.translation.z());
    transform.transform().rotation(ToWire(one.T_frame_child.rotation));
    wire.transforms().push_back(std::move(transform));
  }
  return wire;
}

::geometry_msgs::msg::dds_::PoseWithCovarianceStamped_ ToWire(const PoseWithCovariance& value) {
  ::geometry_msgs::msg::dds_::PoseWithCovarianceStamped_ wire;
  wire.header(ToWire(value.header));
  wire.pose().pose(ToWire(value.pose));
  wire.pose().covariance(value.covariance);
  return wire;
}

::nav_msgs::msg::dds_::OccupancyGrid_ ToWire(const Grid& value) {
  ::nav_msgs::msg::dds_::OccupancyGrid_ wire;
  wire.header(ToWire(value.header));
  wire.info().map_load_time(TimeOf(value.loaded));
  wire.info().resolution(static_cast<float>(value.resolution));
  wire.info().width(value.width);
  wire.info().height(value.height);
  wire.info().origin(ToWire(value.T_frame_origin));
  wire.data(value.cells);
  return wire;
}

::map_msgs::msg::dds_::OccupancyGridUpdate_ ToWire(const GridUpdate& value) {
  ::map_msgs::msg::dds_::OccupancyGridUpdate_ wire;
  wire.header(ToWire(value.header));
  wire.x(value.x);
  wire.y(value.y);
  wire.width(value.width);
  wire.height(value.height);
  wire.data(value.cells);
  return wire;
}

}  // namespace cairn::ros2
