// A log as a sequence of steps, each measured by odometry, by scan matching on its own, and by the matcher whose errors
// are to be learnt. A step begins and ends at a scan; it ends where odometry says the robot has moved enough (never
// where the scans say so: that would choose steps by the very error to be learnt). Whole in memory, one small record a
// step. Motions are T_prev_curr in the robot frame.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "common/sensor/log_reader.h"
#include "common/status.h"
#include "server/slam/mapper_options.h"
#include "server/slam/parallel_for.h"

namespace cairn::server {

struct LogStep {
  Stamp from = 0;
  Stamp to = 0;
  Pose2 odometry;
  slam::MatchResult match;  // Point to line; odometry is its start, hardly its prior.
  slam::MatchResult blind;  // slam.matcher from a forecast at constant speed: without odometry.
  double lambda_m = 0.0;    // The way the forecast expected.
};

struct LogSteps {
  std::vector<LogStep> steps;  // All of them, in order; `match` may have failed.
  int scans = 0;
  int unusable_scans = 0;  // Not valid, without odometry, or tilted.
};

struct LogStepOptions {
  slam::MapperOptions slam;  // Gate, pairing, features, matchers.
  LogReaderOptions reader;
  std::int64_t max_steps = 0;  // 0: all.
  double max_step_m = 3.0;     // Longer is a jump of the odometry: the step is left out.
  double wide_m = 0.5;         // Prior of both matches: so wide that the scans decide.
  double wide_rad = 0.5;
};

[[nodiscard]] Result<LogSteps> MeasureSteps(const std::filesystem::path& log, const LogStepOptions& options,
                                            const slam::ParallelFor& parallel_for);

// Whether a step's match says anything about the robot: converged, no direction open.
[[nodiscard]] bool IsMeasured(const LogStep& step);

}  // namespace cairn::server
