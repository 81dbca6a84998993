// Runs the estimator once over a log and measures the time of each scan.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/sensor/log_record.h"
#include "common/sensor/trajectory.h"
#include "common/service/ledger.h"
#include "common/status.h"
#include "server/slam/scan_pipeline.h"
#include "server/slam/tracking/scan_steps.h"
#include "server/tools/offline/options.h"

namespace cairn::server {

struct OfflineReport {
  std::vector<double> scan_ms;      // Estimator time per scan, in order.
  std::vector<double> scan_cpu_ms;  // The same in processor time of the thread that runs the estimator,
  // and that by the steps of the estimator: the sum over all scans, and the part of each step in the slowest scan.
  std::array<double, slam::kScanStepCount> step_ms{};
  std::array<double, slam::kScanStepCount> slowest_scan_step_ms{};
  double wall_s = 0.0;  // Whole run: reading, estimating, writing.
  double cpu_s = 0.0;
  double peak_rss_mib = 0.0;
  std::uint64_t scans_used = 0;
  std::uint64_t keyframes = 0;
  std::uint64_t not_localized = 0;  // Scans whose pose was reported as lost.
  std::array<std::uint64_t, kDropReasonCount> dropped{};
  std::uint64_t odometry_dropped = 0;
  std::size_t landmarks = 0;
  LogSummary log;
};

// Reads the log, runs the estimator, and writes the requested files.
[[nodiscard]] Result<OfflineReport> RunOffline(const OfflineOptions& options);

[[nodiscard]] std::string ReportText(const OfflineReport& report);
[[nodiscard]] std::string ReportJson(const OfflineReport& report);

}  // namespace cairn::server
