// `cairn-calibrate motion`: Eliazar's model of a robot's odometry and the model of a scan matcher's errors, both learnt
// from one log.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "common/status.h"
#include "server/calibrate/log_steps.h"
#include "server/slam/motion/eliazar_fit.h"
#include "server/slam/motion/scan_matching_model.h"

namespace cairn::server {

struct MotionRunOptions {
  MotionRunOptions() { slam.matcher = slam::MatcherKind::kIcp; }

  std::filesystem::path log;
  std::filesystem::path truth;  // Empty: the estimator's whole path stands for it.
  bool matcher_model = true;
  std::int64_t max_steps = 0;
  std::int64_t threads = 0;
  slam::MapperOptions slam;
  slam::EliazarFitOptions fit;
};

struct MotionReport {
  int scans = 0;
  int unusable_scans = 0;
  int steps = 0;
  int unmeasured_steps = 0;  // No match, or one with an open direction.
  double mean_step_m = 0.0;
  double mean_step_rad = 0.0;
  slam::EliazarFit eliazar;
  std::optional<slam::ScanMatchingFit> matcher;
  std::string matcher_name;
  bool truth_given = false;
  int unmatched_blind = 0;  // Steps the matcher without odometry gave up on.
  // Where the truth is given: root mean square of the match errors over their stated sigmas (1: honest).
  std::optional<double> match_honesty;
};

[[nodiscard]] Result<MotionReport> RunMotion(const MotionRunOptions& options);
[[nodiscard]] std::string ReportText(const MotionReport& report);
[[nodiscard]] std::string ReportJson(const MotionReport& report);
// As options of the estimator (YAML): slam.motion, and the filters that sample motion told to use it: Eliazar's model
// with odometry, without it the scan matcher's. kInvalidArgument where the matcher's model was not learnt, or a number
// is out of its option's range.
[[nodiscard]] Result<std::string> ReportConfig(const MotionReport& report, bool with_odometry);

}  // namespace cairn::server
