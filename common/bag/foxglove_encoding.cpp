#include "common/bag/foxglove_encoding.h"

#include <google/protobuf/descriptor.pb.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "cairn/recording.pb.h"
#include "foxglove/messages.pb.h"

namespace cairn::bag {
namespace {

namespace pb = google::protobuf;

void AddFile(const pb::FileDescriptor& file, std::set<const pb::FileDescriptor*>& added, pb::FileDescriptorSet& set) {
  if (!added.insert(&file).second) return;
  for (int i = 0; i < file.dependency_count(); ++i) AddFile(*file.dependency(i), added, set);
  file.CopyTo(set.add_file());
}

// Rounds down, so that the nanoseconds of stamps before 1970 count forwards too.
void SetTimestamp(Stamp stamp, pb::Timestamp& timestamp) {
  Stamp seconds = stamp / kNanosPerSecond, nanoseconds = stamp % kNanosPerSecond;
  if (nanoseconds < 0) {
    --seconds;
    nanoseconds += kNanosPerSecond;
  }
  timestamp.set_seconds(seconds);
  timestamp.set_nanos(static_cast<std::int32_t>(nanoseconds));
}

template <typename Vector>
void SetPosition(const Pose2& pose, Vector& position) {
  position.set_x(pose.x);
  position.set_y(pose.y);
}

// A turn about z by the heading, then about y by the tilt, which looks down where it is positive.
void SetRotation(double theta, double tilt, foxglove::Quaternion& rotation) {
  const double cos_z = std::cos(theta / 2), sin_z = std::sin(theta / 2);
  const double cos_y = std::cos(tilt / 2), sin_y = std::sin(tilt / 2);
  rotation.set_x(0.0 - sin_z * sin_y);  // Not -0.
  rotation.set_y(cos_z * sin_y);
  rotation.set_z(sin_z * cos_y);
  rotation.set_w(cos_z * cos_y);
}

void SetPose(const Pose2& pose, double tilt, foxglove::Pose& message) {
  SetPosition(pose, *message.mutable_position());
  SetRotation(pose.theta, tilt, *message.mutable_orientation());
}

void SetExactPose(const Pose2& pose, recording::Pose& message) {
  message.set_x(pose.x);
  message.set_y(pose.y);
  message.set_theta(pose.theta);
}

void AddByteField(const char* name, std::uint32_t offset, foxglove::Grid& grid) {
  foxglove::PackedElementField& field = *grid.add_fields();
  field.set_name(name);
  field.set_offset(offset);
  field.set_type(foxglove::PackedElementField::UINT8);
}

}  // namespace

std::string DescriptorsOf(const std::string& schema) {
  const bool ours = schema == kScanDetailsSchema || schema == kOdometryDetailsSchema;
  pb::FileDescriptorSet set;
  std::set<const pb::FileDescriptor*> added;
  AddFile(ours ? *recording::ScanDetails::descriptor()->file() : *foxglove::LaserScan::descriptor()->file(), added,
          set);
  return set.SerializeAsString();
}

std::string EncodeLaserScan(const Scan& scan, const std::string& frame) {
  foxglove::LaserScan message;
  SetTimestamp(scan.stamp, *message.mutable_timestamp());
  message.set_frame_id(frame);
  SetPose(scan.T_robot_laser, scan.tilt_rad, *message.mutable_pose());
  const auto gaps = static_cast<double>(std::max<std::size_t>(scan.ranges_m.size(), 1) - 1);
  message.set_start_angle(scan.angle_first_rad);
  message.set_end_angle(scan.angle_first_rad + scan.angle_step_rad * gaps);
  message.mutable_ranges()->Reserve(static_cast<int>(scan.ranges_m.size()));
  for (const float range : scan.ranges_m) message.add_ranges(range);
  return message.SerializeAsString();
}

std::string EncodeDetails(const Scan& scan, std::uint64_t session) {
  recording::ScanDetails message;
  message.set_stamp_ns(scan.stamp);
  message.set_angle_first_rad(scan.angle_first_rad);
  message.set_angle_step_rad(scan.angle_step_rad);
  message.set_range_min_m(scan.range_min_m);
  message.set_range_max_m(scan.range_max_m);
  message.set_beam_period_s(scan.beam_period_s);
  message.set_tilt_rad(scan.tilt_rad);
  SetExactPose(scan.T_robot_laser, *message.mutable_t_robot_laser());
  message.set_session(session);
  message.set_sequence(scan.sequence);
  return message.SerializeAsString();
}

std::string EncodeDetails(const Odometry& odometry, std::uint64_t session) {
  recording::OdometryDetails message;
  message.set_stamp_ns(odometry.stamp);
  SetExactPose(odometry.T_odom_robot, *message.mutable_t_odom_robot());
  message.set_session(session);
  message.set_sequence(odometry.sequence);
  return message.SerializeAsString();
}

std::string EncodePose(Stamp stamp, const std::string& frame, const Pose2& T_frame_body) {
  foxglove::PoseInFrame message;
  SetTimestamp(stamp, *message.mutable_timestamp());
  message.set_frame_id(frame);
  SetPose(T_frame_body, 0.0, *message.mutable_pose());
  return message.SerializeAsString();
}

std::string EncodeTransform(Stamp stamp, const std::string& parent, const std::string& child,
                            const Pose2& T_parent_child) {
  foxglove::FrameTransform message;
  SetTimestamp(stamp, *message.mutable_timestamp());
  message.set_parent_frame_id(parent);
  message.set_child_frame_id(child);
  SetPosition(T_parent_child, *message.mutable_translation());
  SetRotation(T_parent_child.theta, 0.0, *message.mutable_rotation());
  return message.SerializeAsString();
}

std::string EncodeGrid(Stamp stamp, const std::string& frame, const OccupancyImage& map) {
  constexpr std::uint32_t kCellBytes = 3;
  constexpr int kOccupied = 100;
  foxglove::Grid message;
  SetTimestamp(stamp, *message.mutable_timestamp());
  message.set_frame_id(frame);
  SetPose(map.T_map_origin, 0.0, *message.mutable_pose());
  message.set_column_count(static_cast<std::uint32_t>(map.width));
  message.mutable_cell_size()->set_x(map.resolution_m);
  message.mutable_cell_size()->set_y(map.resolution_m);
  message.set_row_stride(kCellBytes * static_cast<std::uint32_t>(map.width));
  message.set_cell_stride(kCellBytes);
  AddByteField("occupancy", 0, message);
  for (const char* colour : {"red", "green", "blue"}) AddByteField(colour, 1, message);  // The same byte: grey.
  AddByteField("alpha", 2, message);
  std::string& data = *message.mutable_data();
  data.resize(map.cells.size() * kCellBytes);
  std::size_t at = 0;
  for (const std::uint8_t cell : map.cells) {
    const bool known = cell <= kOccupied;
    data[at++] = static_cast<char>(cell);
    data[at++] = static_cast<char>(known ? 255 - 255 * cell / kOccupied : 0);
    data[at++] = static_cast<char>(known ? 255 : 0);
  }
  return message.SerializeAsString();
}

std::string EncodeLog(Stamp stamp, LogLevel level, const std::string& name, const std::string& message) {
  foxglove::Log log;
  SetTimestamp(stamp, *log.mutable_timestamp());
  log.set_level(level == LogLevel::kInfo      ? foxglove::Log::INFO
                : level == LogLevel::kWarning ? foxglove::Log::WARNING
                                              : foxglove::Log::ERROR);
  log.set_name(name);
  log.set_message(message);
  return log.SerializeAsString();
}

}  // namespace cairn::bag
