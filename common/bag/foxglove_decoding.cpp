#include "common/bag/foxglove_decoding.h"

#include <google/protobuf/stubs/logging.h>

#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "cairn/recording.pb.h"
#include "common/ros2/message_checks.h"
#include "foxglove/messages.pb.h"

namespace cairn::bag {
namespace {

constexpr std::size_t kMostBytes = std::size_t{4} << 20;  // Of one message: far longer than any scan.
constexpr double kUnstatedRangeMax = 80.0;

tl::unexpected<Status> NotOne(const std::string& name) {
  return Fail(StatusCode::kInvalidArgument, "the bytes are no " + name);
}

template <typename Message>
Result<Message> Parse(std::string_view bytes) {
  Message message;
  if (bytes.size() > kMostBytes) return Fail(StatusCode::kOutOfRange, "a message is too long");
  const google::protobuf::LogSilencer silent;  // Protobuf prints what it dislikes, and a library must not.
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return NotOne(Message::descriptor()->full_name());
  return message;
}

Result<ros2::Header> HeaderOf(const google::protobuf::Timestamp& timestamp, const std::string& frame) {
  constexpr std::int64_t kMostSeconds = std::numeric_limits<Stamp>::max() / kNanosPerSecond - 1;
  if (timestamp.seconds() < -kMostSeconds || timestamp.seconds() > kMostSeconds || timestamp.nanos() < 0 ||
      timestamp.nanos() >= kNanosPerSecond)
    return Fail(StatusCode::kOutOfRange, "a stamp is out of range");
  auto name = ros2::FrameName(frame);
  if (!name) return tl::unexpected(name.error());
  return ros2::Header{timestamp.seconds() * kNanosPerSecond + timestamp.nanos(), *std::move(name)};
}

ros2::Pose3 PoseOf(const foxglove::Vector3& position, const foxglove::Quaternion& rotation, bool turned) {
  ros2::Pose3 pose;
  pose.translation = {position.x(), position.y(), position.z()};
  if (turned) pose.rotation = Eigen::Quaterniond(rotation.w(), rotation.x(), rotation.y(), rotation.z());
  return pose;
}
ros2::Pose3 PoseOf(const foxglove::Pose& pose) {
  return PoseOf(pose.position(), pose.orientation(), pose.has_orientation());
}

// A double that no float can hold is as good as infinite.
float FloatOf(double number) {
  constexpr double kMost = std::numeric_limits<float>::max();
  if (std::abs(number) <= kMost || std::isnan(number)) return static_cast<float>(number);
  return number > 0.0 ? std::numeric_limits<float>::infinity() : -std::numeric_limits<float>::infinity();
}

Result<void> AddTransform(const foxglove::FrameTransform& message, ros2::Transforms& transforms) {
  if (transforms.transforms.size() >= ros2::kMaxTransforms)
    return Fail(StatusCode::kOutOfRange, "more than 1024 transforms");
  auto header = HeaderOf(message.timestamp(), message.parent_frame_id());
  if (!header) return tl::unexpected(header.error());
  auto child = ros2::FrameName(message.child_frame_id());
  if (!child) return tl::unexpected(child.error());
  transforms.transforms.push_back({*std::move(header), *std::move(child),
                                   PoseOf(message.translation(), message.rotation(), message.has_rotation())});
  return {};
}

Result<Pose2> PoseOf(const recording::Pose& message) {
  const Pose2 pose{message.x(), message.y(), message.theta()};
  if (!pose.IsFinite()) return Fail(StatusCode::kOutOfRange, "a pose is not finite");
  return pose;
}

}  // namespace

Result<ScanMessage> DecodeFoxgloveScan(std::string_view bytes) {
  const auto message = Parse<foxglove::LaserScan>(bytes);
  if (!message) return tl::unexpected(message.error());
  auto header = HeaderOf(message->timestamp(), message->frame_id());
  if (!header) return tl::unexpected(header.error());
  const auto count = static_cast<std::size_t>(message->ranges_size());
  if (count > ros2::kMaxRanges) return Fail(StatusCode::kOutOfRange, "a scan has too many ranges");
  ScanMessage decoded;
  decoded.T_frame_scan = PoseOf(message->pose());
  ros2::LaserScan& scan = decoded.scan;
  scan.header = *std::move(header);
  scan.angle_min = message->start_angle();
  if (count > 1)
    scan.angle_increment = (message->end_angle() - message->start_angle()) / static_cast<double>(count - 1);
  scan.range_max = kUnstatedRangeMax;
  scan.ranges.reserve(count);
  for (const double range : message->ranges()) scan.ranges.push_back(FloatOf(range));
  return decoded;
}

Result<ros2::Odometry> DecodePoseInFrame(std::string_view bytes) {
  const auto message = Parse<foxglove::PoseInFrame>(bytes);
  if (!message) return tl::unexpected(message.error());
  auto header = HeaderOf(message->timestamp(), message->frame_id());
  if (!header) return tl::unexpected(header.error());
  return ros2::Odometry{*std::move(header), "", PoseOf(message->pose())};
}

Result<ros2::Transforms> DecodeFrameTransform(std::string_view bytes) {
  const auto message = Parse<foxglove::FrameTransform>(bytes);
  if (!message) return tl::unexpected(message.error());
  ros2::Transforms transforms;
  if (auto added = AddTransform(*message, transforms); !added) return tl::unexpected(added.error());
  return transforms;
}

Result<ros2::Transforms> DecodeFrameTransforms(std::string_view bytes) {
  const auto message = Parse<foxglove::FrameTransforms>(bytes);
  if (!message) return tl::unexpected(message.error());
  ros2::Transforms transforms;
  for (const foxglove::FrameTransform& one : message->transforms())
    if (auto added = AddTransform(one, transforms); !added) return tl::unexpected(added.error());
  return transforms;
}

Result<Scan> DecodeScanDetails(std::string_view bytes) {
  const auto message = Parse<recording::ScanDetails>(bytes);
  if (!message) return tl::unexpected(message.error());
  const auto T_robot_laser = PoseOf(message->t_robot_laser());
  if (!T_robot_laser) return tl::unexpected(T_robot_laser.error());
  Scan scan;
  scan.sequence = message->sequence();
  scan.stamp = message->stamp_ns();
  scan.angle_first_rad = message->angle_first_rad();
  scan.angle_step_rad = message->angle_step_rad();
  scan.range_min_m = message->range_min_m();
  scan.range_max_m = message->range_max_m();
  scan.beam_period_s = message->beam_period_s();
  scan.tilt_rad = message->tilt_rad();
  scan.T_robot_laser = *T_robot_laser;
  return scan;
}

Result<Odometry> DecodeOdometryDetails(std::string_view bytes) {
  const auto message = Parse<recording::OdometryDetails>(bytes);
  if (!message) return tl::unexpected(message.error());
  const auto pose = PoseOf(message->t_odom_robot());
  if (!pose) return tl::unexpected(pose.error());
  return Odometry{message->sequence(), message->stamp_ns(), *pose};
}

}  // namespace cairn::bag
