// Divides a log into steps. Each step is measured three times: by odometry, by scan matching alone, and by
// the matcher whose errors are to be learnt. A step begins and ends at a scan. It ends when the odometry has
// moved far enough; the scans must not decide this, because then the errors to be learnt would influence the
// choice of steps. All steps are kept in memory, as one small record each. Motions are T_prev_curr in the
// robot frame.
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
  slam::MatchResult match;  // Point-to-line matching, started at the odometry with a very wide prior.
  slam::MatchResult blind;  // slam.matcher, started at a constant-speed forecast, without odometry.
  double lambda_m = 0.0;    // Distance that the forecast predicted.
};

struct LogSteps {
  std::vector<LogStep> steps;  // All steps in order, including those whose `match` failed.
  int scans = 0;
  int unusable_scans = 0;  // Scans that are not valid, have no odometry, or are tilted.
};

struct LogStepOptions {
  slam::MapperOptions slam;  // Gate, pairing, features, matchers.
  LogReaderOptions reader;
  std::int64_t max_steps = 0;  // 0: all.
  double max_step_m = 3.0;     // Longer steps are jumps of the odometry and are left out.
  double wide_m = 0.5;         // Prior of both matches, wide enough that the scans determine the result.
  double wide_rad = 0.5;
};

[[nodiscard]] Result<LogSteps> MeasureSteps(const std::filesystem::path& log, const LogStepOptions& options,
                                            const slam::ParallelFor& parallel_for);

// Whether the match of a step is usable: it has converged and determines every direction.
[[nodiscard]] bool IsMeasured(const LogStep& step);

}  // namespace cairn::server
