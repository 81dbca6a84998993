// Reads a robot log in CARMEN format (ODOM, FLASER, RLASER and the newer ROBOTLASER1, RAWLASER1) or in DP-SLAM's own
// (Odometry x y theta / Laser n r..., no stamps). The format is recognised from the content. Records come in file
// order. A bad line is skipped with line number and reason; an unreadable file is an error.
// Two passes: the first surveys the file (log_survey.h), the second emits.
//
// - FLASER n r_1..r_n  x y theta  odom_x odom_y odom_theta  stamp host logger_stamp yields an Odometry and a Scan with
//   the same stamp (an ODOM of that stamp just before is not repeated). Field of view 180 deg, first beam at -90 deg,
//   step 180/n for even n, 180/(n-1) for odd n (CARMEN's convention). T_robot_laser follows from laser and robot poses.
// - ROBOTLASER1 likewise, layout and range limit from the message. RAWLASER1 has no poses: the Scan alone; where the
//   file also holds ROBOTLASER1 the raw twins are ignored. So is a laser message that repeats another's stamp and
//   count.
// - TILTLASER1 tilt <as ROBOTLASER1> is our extension for scanners on a tilting mount: a scan whose plane is turned by
//   `tilt` (rad) about the laser's y axis, positive downwards. Other readers skip it, as tilted scans would spoil a
//   flat map; level scans of the same scanner stay ordinary messages. Its range limit is taken as stated.
// - range_max: options.no_return_m; else the limit a message states; else 80 m (a SICK's limit is 80 m, its answers
//   above mean nothing hit); lowered to where saturated readings pile up. DP-SLAM: options.dpslam_range_max_m, lowered
//   likewise.
// - DP-SLAM logs have no stamps: a Laser and the Odometry before it share one, dpslam_scan_period_s after the last
//   pair's; the first pair is stamped one period. LogReaderOptions carries laser offset and range.
// - A lidar that turns measures its beams one after the other. What LogReaderOptions::timing says of it, or else the
//   log itself, gives the beams their times (lidar_timing.h); the stamp of a scan is then that of its first beam, while
//   odometry keeps its stamp. In a log, the lines `PARAM lidar_scan_period S`, `PARAM lidar_stamp_at
//   first|middle|last`, `PARAM lidar_clockwise on|off` and `PARAM lidar_turn_from DEG` count for all scans after them.
// Scans are not validated here (ValidateScan), sequence numbers are 0. Memory is bounded for files of any size.
// Source: CARMEN logger message list; DP-SLAM README (Eliazar, Parr 2003).
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "common/sensor/lidar_timing.h"
#include "common/sensor/log_record.h"
#include "common/status.h"

namespace cairn {

struct LogReaderOptions {
  double no_return_m = 0.0;  // > 0: ranges at or above it hit nothing. 0: from the log's format and content.
  double dpslam_laser_forward_m = 0.40;  // DP-SLAM logs: laser ahead of the robot's pivot.
  double dpslam_range_max_m = 8.19;
  double dpslam_scan_period_s = 0.2;                  // DP-SLAM logs carry no time.
  LidarTiming timing = {};                            // Counts before what the log says.
  std::optional<Pose2> T_robot_laser = std::nullopt;  // Counts before what the log says.
  // Bags of ROS 2 (bag/bag_reader.h): the topics of scans and odometry. Empty: the only ones of their types.
  std::string scan_topic = {};
  std::string odometry_topic = {};
  // Several topics of scans are the lidars of one robot. Otherwise one has to be chosen.
  bool all_lidars = false;
};

// The path must be a regular file (it is read twice). Calls `sink` for every record; a sink that returns false ends the
// reading early.
[[nodiscard]] Result<LogSummary> ReadLog(const std::filesystem::path& path, const LogReaderOptions& options,
                                         const std::function<bool(LogRecord&&)>& sink);

}  // namespace cairn
