// `cairn-calibrate motion` learns two models from one log: Eliazar's model of the robot's odometry, and the
// model of a scan matcher's errors.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "common/status.h"
#include "server/slam/calibration/eliazar_fit.h"
#include "server/slam/calibration/scan_matching_fit.h"
#include "server/tools/calibrate/log_steps.h"

namespace cairn::server {

struct MotionRunOptions {
  MotionRunOptions() { slam.matcher = slam::MatcherKind::kIcp; }

  std::filesystem::path log;
  std::filesystem::path truth;  // Empty: the estimator's whole path is used in its place.
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
  int unmeasured_steps = 0;  // Steps without a match, or with one that leaves a direction undetermined.
  double mean_step_m = 0.0;
  double mean_step_rad = 0.0;
  slam::EliazarFit eliazar;
  std::optional<slam::ScanMatchingFit> matcher;
  std::string matcher_name;
  bool truth_given = false;
  int unmatched_blind = 0;  // Steps on which the matcher without odometry failed.
  // Set if the truth is given: root mean square of match error / stated sigma. It is 1 if the stated sigmas
  // are right.
  std::optional<double> match_error_ratio;
};

[[nodiscard]] Result<MotionReport> RunMotion(const MotionRunOptions& options);
[[nodiscard]] std::string ReportText(const MotionReport& report);
[[nodiscard]] std::string ReportJson(const MotionReport& report);
// Returns the learnt models as options of the estimator (YAML): slam.motion, and the options that make the
// sampling filters use it (Eliazar's model with odometry, the scan matcher's model without).
// kInvalidArgument: the matcher's model was not learnt, or a number is out of its option's range.
[[nodiscard]] Result<std::string> ReportConfig(const MotionReport& report, bool with_odometry);

}  // namespace cairn::server
