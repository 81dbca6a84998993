#include "common/ros2/cdr_decoding.h"

#include <utility>

#include "common/ros2/cdr_reader.h"
#include "common/ros2/message_checks.h"

namespace cairn::ros2 {
namespace {

tl::unexpected<Status> Undecodable() {
  return Fail(StatusCode::kDataLoss, "the message is cut off, or is not plain CDR");
}

Result<Header> TakeHeader(CdrReader& cdr) {
  const auto seconds = cdr.Take<std::int32_t>();
  const auto nanoseconds = cdr.Take<std::uint32_t>();
  const auto stamp = StampOfTime(seconds, nanoseconds);
  if (!stamp) return tl::unexpected(stamp.error());
  auto frame = FrameName(cdr.TakeString());
  if (!frame) return tl::unexpected(frame.error());
  return Header{*stamp, *std::move(frame)};
}

// geometry_msgs/msg/Pose and Transform: both are a position and a quaternion x, y, z, w.
Pose3 TakePose(CdrReader& cdr) {
  Pose3 pose;
  for (int i = 0; i < 3; ++i) pose.translation[i] = cdr.Take<double>();
  for (int i = 0; i < 4; ++i) pose.rotation.coeffs()[i] = cdr.Take<double>();
  return pose;
}

}  // namespace

Result<LaserScan> DecodeLaserScan(std::string_view bytes) {
  CdrReader cdr(bytes);
  auto header = TakeHeader(cdr);
  if (!header) return tl::unexpected(header.error());
  LaserScan scan;
  scan.header = *std::move(header);
  scan.angle_min = cdr.Take<float>();
  cdr.Take<float>();  // angle_max follows from the number of rays.
  scan.angle_increment = cdr.Take<float>();
  scan.time_increment = cdr.Take<float>();
  scan.scan_time = cdr.Take<float>();
  scan.range_min = cdr.Take<float>();
  scan.range_max = cdr.Take<float>();
  scan.ranges = cdr.TakeFloats();
  if (!cdr.ok()) return Undecodable();
  if (scan.ranges.size() > kMaxRanges) return Fail(StatusCode::kOutOfRange, "a scan has too many ranges");
  return scan;
}

Result<Odometry> DecodeOdometry(std::string_view bytes) {
  CdrReader cdr(bytes);
  auto header = TakeHeader(cdr);
  if (!header) return tl::unexpected(header.error());
  auto child = FrameName(cdr.TakeString());
  if (!child) return tl::unexpected(child.error());
  const Pose3 pose = TakePose(cdr);
  if (!cdr.ok()) return Undecodable();
  return Odometry{*std::move(header), *std::move(child), pose};
}

Result<Transforms> DecodeTransforms(std::string_view bytes) {
  constexpr std::size_t kLeastBytes = 72;  // Of one: a stamp, two empty names and seven numbers.
  CdrReader cdr(bytes);
  const std::uint32_t count = cdr.TakeCount(kLeastBytes);
  if (count > kMaxTransforms) return Fail(StatusCode::kOutOfRange, "too many transforms");
  Transforms message;
  for (std::uint32_t i = 0; i < count; ++i) {
    auto header = TakeHeader(cdr);
    if (!header) return tl::unexpected(header.error());
    auto child = FrameName(cdr.TakeString());
    if (!child) return tl::unexpected(child.error());
    const Pose3 T_frame_child = TakePose(cdr);
    message.transforms.push_back({*std::move(header), *std::move(child), T_frame_child});
  }
  if (!cdr.ok()) return Undecodable();
  return message;
}

}  // namespace cairn::ros2
