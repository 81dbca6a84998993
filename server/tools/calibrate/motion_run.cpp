#include "server/tools/calibrate/motion_run.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "common/bag/recording.h"
#include "common/sensor/trajectory.h"
#include "server/slam/scan_pipeline.h"
#include "server/tools/log_run/over_threads.h"

namespace cairn::server {
namespace {

constexpr double kMaxPoseGap_s = 1.0;
constexpr int kFewestSteps = 50;  // Twelve parameters cannot be learnt from fewer steps.

Result<Trajectory> PathOfEstimator(const MotionRunOptions& options, const slam::ParallelFor& parallel_for) {
  slam::MapperOptions slam = options.slam;
  slam.matcher = slam::MapperOptions{}.matcher;  // The estimator at its best; slam.matcher is what is examined.
  slam::ScanPipeline pipeline(slam, {}, parallel_for,
                              {[](const Scan&, const slam::ScanOutcome&) {}, [](const Scan&, DropReason) {}});
  const auto read = ReadRecording(options.log, {}, [&](LogRecord&& record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      if (ValidateOdometry(*odometry)) pipeline.Add(*odometry);
    } else if (auto scan = std::make_shared<const Scan>(std::move(std::get<Scan>(record))); ValidateScan(*scan)) {
      pipeline.Add(std::move(scan));
    }
    return true;
  });
  if (!read) return tl::unexpected(read.error());
  pipeline.Finish();
  return pipeline.mapper().Snapshot().FullTrajectory();
}

std::optional<Pose2> MotionBetween(const Trajectory& path, const LogStep& step) {
  const auto from = PoseOn(path, step.from, kMaxPoseGap_s), to = PoseOn(path, step.to, kMaxPoseGap_s);
  if (!from || !to) return std::nullopt;
  return Between(*from, *to);
}

double SquaredSigmas(const slam::MatchResult& match, const Pose2& truth) {
  Eigen::Vector3d error(match.T_ref_curr.x - truth.x, match.T_ref_curr.y - truth.y,
                        AngleDiff(match.T_ref_curr.theta, truth.theta));
  return error.dot(match.covariance.ldlt().solve(error));
}

}  // namespace

Result<MotionReport> RunMotion(const MotionRunOptions& options) {
  const slam::ParallelFor parallel_for = OverThreads(options.threads);
  LogStepOptions step_options;
  step_options.slam = options.slam;
  step_options.max_steps = options.max_steps;
  const auto measured = MeasureSteps(options.log, step_options, parallel_for);
  if (!measured) return tl::unexpected(measured.error());

  MotionReport report;
  report.scans = measured->scans;
  report.unusable_scans = measured->unusable_scans;
  std::vector<slam::MeasuredStep> steps;
  for (const LogStep& step : measured->steps) {
    if (!IsMeasured(step)) {
      ++report.unmeasured_steps;
      continue;
    }
    steps.push_back({slam::StepOf(step.odometry), step.match.T_ref_curr, step.match.covariance});
    report.mean_step_m += std::abs(steps.back().odometry.d);
    report.mean_step_rad += std::abs(steps.back().odometry.b);
  }
  report.steps = static_cast<int>(steps.size());
  if (report.steps < kFewestSteps)
    return Fail(StatusCode::kFailedPrecondition, options.log.string() + ": only " + std::to_string(report.steps) +
                                                     " of " + std::to_string(measured->steps.size()) +
                                                     " steps could be measured by scan matching, at least " +
                                                     std::to_string(kFewestSteps) + " are needed");
  report.mean_step_m /= report.steps;
  report.mean_step_rad /= report.steps;
  report.eliazar = slam::FitEliazar(steps, {}, options.fit, parallel_for);
  if (!options.matcher_model) return report;

  report.truth_given = !options.truth.empty();
  const Result<Trajectory> truth = report.truth_given ? ReadTum(options.truth) : PathOfEstimator(options, parallel_for);
  if (!truth) return tl::unexpected(truth.error());
  std::vector<slam::MatchSample> samples;
  double squared_ratio = 0.0;
  int compared = 0;
  for (const LogStep& step : measured->steps) {
    const auto motion = MotionBetween(*truth, step);
    if (!motion) continue;
    if (IsMeasured(step)) {
      squared_ratio += SquaredSigmas(step.match, *motion) / 3.0;
      ++compared;
    }
    if (!step.blind.converged) {
      ++report.unmatched_blind;
      continue;
    }
    samples.push_back({step.blind.T_ref_curr, *motion, step.lambda_m});
  }
  if (samples.empty())
    return Fail(StatusCode::kFailedPrecondition,
                report.truth_given ? options.truth.string() + ": no pose at the stamps of the log's steps"
                                   : options.log.string() + ": the matcher converged on no step");
  if (report.truth_given && compared > 0) report.match_error_ratio = std::sqrt(squared_ratio / compared);
  report.matcher = slam::FitScanMatching(samples, {});
  report.matcher_name = slam::MatcherName(options.slam.matcher);
  return report;
}

}  // namespace cairn::server
