// Runs the whole estimator once over a log in this process, as cairn-offline does, and returns all figures.
// Run only one at a time, because two runs at once would disturb each other's times.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/map/occupancy_image.h"
#include "common/sensor/trajectory.h"
#include "common/service/learned_value.h"
#include "server/slam/mapper.h"
#include "tests/studies/logs.h"
#include "tests/studies/relations.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {

inline constexpr int kPoseReasonCount = static_cast<int>(PoseReason::kNotJoined) + 1;

struct LogRun {
  Trajectory online;  // The poses as estimated during the run.
  // Of each pose of `online`: its covariance of (x, y, theta) in map.
  std::vector<Eigen::Matrix3d> covariances;
  Trajectory full;                   // The path of the best particle at the end.
  std::vector<double> scan_cpu_ms;   // Processor time per scan used, all threads.
  std::vector<double> scan_wall_ms;  // ... and on the wall.
  double user_cpu_s = 0.0;           // Of the whole run, user mode.
  std::uint64_t scans_dropped = 0;
  std::uint64_t keyframes = 0;
  // Number of scans by the reason that the mapper reported for the pose.
  std::array<std::uint64_t, kPoseReasonCount> reasons{};
  std::uint64_t not_localized = 0;
  // For each pose of `online`: whether the mapper reported it as localized.
  std::vector<std::uint8_t> localized;
  std::size_t landmarks = 0;
  std::vector<LearnedValue> learned;  // Mapper::learned at the end.
  slam::MapperSnapshot snapshot;

  [[nodiscard]] Distribution time_ms() const { return DistributionOf(scan_cpu_ms); }
};

// Runs in the calling thread. `options.seed` is used.
[[nodiscard]] LogRun RunOverLog(const StudyLog& log, const slam::MapperOptions& options);

// The map drawn again along one of the two paths.
enum class WhichPath : std::uint8_t { kOnline, kFull };
[[nodiscard]] OccupancyImage MapOf(const LogRun& run, WhichPath path, const slam::GridOptions& options);

}  // namespace cairn::studies
