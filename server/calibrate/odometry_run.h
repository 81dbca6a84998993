// `cairn-calibrate odometry`: UMBmark over a file of runs, or over simulated ones with known errors.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "common/status.h"
#include "server/slam/motion/square_run.h"
#include "server/slam/motion/umbmark.h"

namespace cairn::server {

struct OdometryRunOptions {
  std::filesystem::path runs;  // Or simulated ones:
  bool simulate = false;
  int simulated_runs = 5;  // Each way; as many again over bumps, where there are bumps.
  std::uint64_t seed = 1;
  slam::SquareRunOptions run;
  slam::UmbmarkOptions square;
};

struct OdometryReport {
  slam::UmbmarkOptions square;
  slam::UmbmarkResult result;
  std::optional<double> non_systematic_rad;   // (3.11), where there are runs over bumps.
  std::optional<slam::WheelErrors> injected;  // What a simulation had put in.
};

[[nodiscard]] Result<OdometryReport> RunOdometry(const OdometryRunOptions& options);
[[nodiscard]] std::string ReportText(const OdometryReport& report);
[[nodiscard]] std::string ReportJson(const OdometryReport& report);

}  // namespace cairn::server
