// Reads the drive of a robot from a bag of ROS 2 (rosbag2), or from a recording in Foxglove's schemas (those of
// `cairn record`, and of other programs): laser scans and odometry. A bag is a folder with metadata.yaml, or one of its
// files: MCAP, or a database of SQLite. Messages may be compressed one by one (zstd), MCAP also chunk by chunk, and a
// file as a whole (packed_file.h).
//
// - Topics: LogReaderOptions::scan_topic and odometry_topic, or the only ones of their types (bag_topics.h); with
//   LogReaderOptions::all_lidars the scans of several lidars of a robot. Where there is no topic of odometry, the
//   transforms from a frame called odom count.
// - Order: that of the recording, as ROS hands messages to a program; the scans of several lidars in the order of their
//   stamps (scan_order.h). Stamps are those of the messages' headers.
//   Odometry that repeats the stamp before it is left out.
// - Mounting: LogReaderOptions::T_robot_laser, or what the transforms of the bag and the pose of a foxglove.LaserScan
//   say; a mounting that changes in the transforms is taken as it was last. A lidar may hang upside down or be tilted
//   (ros2/scan_conversion.h).
// - Beams: time_increment says when they were measured. LogReaderOptions::timing counts before it, and a scan_period_s
//   of 0 means that all were measured at once. LogReaderOptions::no_return_m as for logs; those for DP-SLAM do not
//   matter.
// - Recordings of `cairn record`: the details beside scans and odometry (idl/cairn/recording.proto) make them the
//   samples that were received, bit for bit. Details that are missing or of another stamp are done without.
// A message that cannot be used is a complaint, with its number among those that are read; a damaged file is an error
// that says where. Scans are not validated here (ValidateScan), sequence numbers are 0.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>

#include "common/sensor/log_reader.h"

namespace cairn::bag {

// A record, and for a scan the number of its lidar in LogSummary::lidars. Returns false to end the reading early.
using RecordingSink = std::function<bool(LogRecord&&, std::size_t lidar)>;

[[nodiscard]] Result<LogSummary> ReadBag(const std::filesystem::path& path, const LogReaderOptions& options,
                                         const RecordingSink& sink);

}  // namespace cairn::bag
