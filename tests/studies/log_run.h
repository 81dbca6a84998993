// One pass of the whole estimator over a log, in this process: what cairn-offline does, with every figure at hand.
// One at a time: times of two at once would say nothing.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/map/occupancy_image.h"
#include "common/sensor/trajectory.h"
#include "server/slam/mapper.h"
#include "tests/studies/logs.h"
#include "tests/studies/relations.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {

inline constexpr int kPoseReasonCount = static_cast<int>(PoseReason::kWaiting) + 1;

struct LogRun {
  Trajectory online;                 // As estimated at the time.
  Trajectory full;                   // Along the best particle's path, at the end.
  std::vector<double> scan_cpu_ms;   // Processor time per scan used, all threads.
  std::vector<double> scan_wall_ms;  // ... and on the wall.
  double user_cpu_s = 0.0;           // Of the whole run, user mode.
  std::uint64_t scans_dropped = 0;
  std::uint64_t keyframes = 0;
  std::array<std::uint64_t, kPoseReasonCount> reasons{};  // Scans by what the mapper said of its pose.
  std::uint64_t not_localized = 0;
  std::vector<std::uint8_t> localized;  // Per pose of `online`: whether the mapper stood by it.
  std::size_t landmarks = 0;
  slam::MapperSnapshot snapshot;

  [[nodiscard]] Distribution time_ms() const { return DistributionOf(scan_cpu_ms); }
};

// In the calling thread. `options.seed` counts.
[[nodiscard]] LogRun RunOverLog(const StudyLog& log, const slam::MapperOptions& options);

// The map drawn anew along one of the two paths.
enum class WhichPath : std::uint8_t { kOnline, kFull };
[[nodiscard]] OccupancyImage MapOf(const LogRun& run, WhichPath path, const slam::GridOptions& options);

}  // namespace cairn::studies
