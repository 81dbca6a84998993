// Values of Cairn as messages that Foxglove shows (idl/foxglove/messages.proto), and what these have no fields for as
// messages of our own (idl/cairn/recording.proto). Names and texts are printable ASCII. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <string>

#include "common/geometry/pose2.h"
#include "common/map/occupancy_image.h"
#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"
#include "common/sensor/stamp.h"

namespace cairn::bag {

// As MCAP names types and encodings.
inline constexpr const char* kProtobuf = "protobuf";
inline constexpr const char* kLaserScanSchema = "foxglove.LaserScan";
inline constexpr const char* kPoseSchema = "foxglove.PoseInFrame";
inline constexpr const char* kTransformSchema = "foxglove.FrameTransform";
inline constexpr const char* kTransformsSchema = "foxglove.FrameTransforms";
inline constexpr const char* kGridSchema = "foxglove.Grid";
inline constexpr const char* kLogSchema = "foxglove.Log";
inline constexpr const char* kScanDetailsSchema = "cairn.recording.ScanDetails";
inline constexpr const char* kOdometryDetailsSchema = "cairn.recording.OdometryDetails";
// The topic of the details of a topic.
inline constexpr const char* kDetailsSuffix = "/details";

// The content of a schema record: a FileDescriptorSet with the file that declares the message and those it needs, which
// come first. REQUIRES: one of the names above.
[[nodiscard]] std::string DescriptorsOf(const std::string& schema);

enum class LogLevel : std::uint8_t { kInfo, kWarning, kError };

// `frame`: that of the robot.
[[nodiscard]] std::string EncodeLaserScan(const Scan& scan, const std::string& frame);
[[nodiscard]] std::string EncodeDetails(const Scan& scan, std::uint64_t session);
[[nodiscard]] std::string EncodeDetails(const Odometry& odometry, std::uint64_t session);
[[nodiscard]] std::string EncodePose(Stamp stamp, const std::string& frame, const Pose2& T_frame_body);
[[nodiscard]] std::string EncodeTransform(Stamp stamp, const std::string& parent, const std::string& child,
                                          const Pose2& T_parent_child);
// Three bytes a cell: its occupancy (0 free .. 100 occupied, 255 unknown), then its grey and opacity, which Foxglove
// shows without being told anything: walls are black, and what is unknown cannot be seen.
[[nodiscard]] std::string EncodeGrid(Stamp stamp, const std::string& frame, const OccupancyImage& map);
[[nodiscard]] std::string EncodeLog(Stamp stamp, LogLevel level, const std::string& name, const std::string& message);

}  // namespace cairn::bag
