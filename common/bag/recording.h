// Reads the drive of a robot from whatever it was recorded in: a bag of ROS 2 or a file of `cairn record`
// (bag_reader.h), or a log in the format of CARMEN or DP-SLAM (sensor/log_reader.h). Which of them is recognised from
// the content.
#pragma once

#include <filesystem>
#include <functional>

#include "common/bag/bag_reader.h"
#include "common/sensor/log_reader.h"

namespace cairn {

// Calls `sink` for every record; a sink that returns false ends the reading early.
[[nodiscard]] Result<LogSummary> ReadRecording(const std::filesystem::path& path, const LogReaderOptions& options,
                                               const std::function<bool(LogRecord&&)>& sink);
// The same, and `sink` learns from which lidar a scan is: always 0 where there is one.
[[nodiscard]] Result<LogSummary> ReadLidars(const std::filesystem::path& path, const LogReaderOptions& options,
                                            const bag::RecordingSink& sink);

}  // namespace cairn
