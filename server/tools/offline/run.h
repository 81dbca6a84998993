// Runs the estimator once over a log, or once over each of several, and measures the time of each scan.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/sensor/log_record.h"
#include "common/sensor/trajectory.h"
#include "common/service/learned_value.h"
#include "common/service/ledger.h"
#include "common/status.h"
#include "server/slam/known_grid/known_grid.h"
#include "server/slam/scan_pipeline.h"
#include "server/slam/tracking/scan_steps.h"
#include "server/tools/log_run/json_line.h"
#include "server/tools/offline/options.h"

namespace cairn::server {

struct OfflineReport {
  std::vector<double> scan_ms;  // Estimator time per scan, in order.
  // The same in processor time of the thread that runs the estimator.
  std::vector<double> scan_cpu_ms;
  // Of that, what the steps of the estimator took: all scans together, and the scan that took longest.
  std::array<double, slam::kScanStepCount> step_ms{};
  std::array<double, slam::kScanStepCount> slowest_scan_step_ms{};
  double wall_s = 0.0;  // Whole run: reading, estimating, writing.
  double cpu_s = 0.0;
  double peak_rss_mib = 0.0;
  std::uint64_t scans_used = 0;
  std::uint64_t keyframes = 0;
  std::uint64_t not_localized = 0;  // Scans whose pose was reported as lost.
  std::uint64_t scans_alone = 0;    // Scans without odometry that could be used (ScanOutcome).
  bool log_has_odometry = false;
  std::array<std::uint64_t, kDropReasonCount> dropped{};
  std::uint64_t odometry_dropped = 0;
  std::size_t landmarks = 0;
  std::vector<LearnedValue> learned;  // Mapper::learned.
  LogSummary log;
};

// One robot after the last scan of its log.
struct OfflineRobot {
  OfflineReport report;
  Trajectory online;
  std::unique_ptr<slam::ScanPipeline> pipeline;
};

// `known`: the map in which the robot is only localised; null: it maps. Then it is at the start, if `place_known`, and
// only its localized poses are in the trajectory.
struct LocalisedIn {
  std::shared_ptr<const slam::KnownGrid> grid;
  bool place_known = false;
};
[[nodiscard]] Result<OfflineRobot> Estimate(const OfflineOptions& options, const std::filesystem::path& log,
                                            const Pose2& T_map_robot_start, const LocalisedIn& known = {});

// Writes, as a TUM trajectory to `known_trajectories[i]`, where the best particle's path now has the robot at each
// scan: large loops have corrected it since the poses were reported, but no job has. Nothing where no such file is
// wanted.
[[nodiscard]] Result<void> WriteKnown(const OfflineOptions& options, std::size_t i,
                                      const slam::MapperSnapshot& snapshot);

[[nodiscard]] Result<void> WriteMap(const slam::OccupancyGrid& grid, const std::filesystem::path& path);

// The time since the start of the program and its memory.
void AddUsage(OfflineReport& report);

// Reads the log, runs the estimator, and writes the requested files. REQUIRES: there is one log.
[[nodiscard]] Result<OfflineReport> RunOffline(const OfflineOptions& options);

[[nodiscard]] std::string ReportText(const OfflineReport& report);
[[nodiscard]] Json JsonOf(const OfflineReport& report);

}  // namespace cairn::server
