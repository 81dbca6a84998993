// `cairn-calibrate laser` estimates from one log what nobody knows of a new robot: the lag between lidar and odometry,
// how the lidar turns, where it is mounted, and the errors of the wheels. It says what the log cannot show.
#pragma once

#include <filesystem>
#include <string>

#include "common/sensor/log_reader.h"
#include "common/status.h"
#include "server/slam/calibration/laser_fit.h"

namespace cairn::server {

struct LaserRunOptions {
  std::filesystem::path log;
  LogReaderOptions reader;  // Its timing is not used: it is what is looked for.
  // Of longer logs the first scans are used; two hours of a lidar that turns five times a second.
  std::int64_t max_scans = 36'000;
  std::int64_t threads = 0;
  slam::LaserFitOptions fit;
};

struct LaserReport {
  int scans = 0;
  int unusable_scans = 0;  // Not valid, tilted, or without a plausible stamp.
  Pose2 T_robot_laser_logged;
  slam::LaserFit fit;
  std::string log_options;  // For cairn-offline, cairn replay and check-log; empty if nothing is needed.
};

[[nodiscard]] Result<LaserReport> RunLaser(const LaserRunOptions& options);
[[nodiscard]] std::string ReportText(const LaserReport& report);
[[nodiscard]] std::string ReportJson(const LaserReport& report);
// What was found as options of the estimator (YAML): lag and wheels. What programs that read the log need besides
// stands in comments at its top.
[[nodiscard]] Result<std::string> ReportConfig(const LaserReport& report);

}  // namespace cairn::server
