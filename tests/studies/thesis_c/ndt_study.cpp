#include "tests/studies/thesis_c/ndt_study.h"

#include <algorithm>
#include <variant>

#include "server/slam/scan/beam_points.h"
#include "server/slam/scan_pipeline.h"
#include "tests/studies/scene.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {

ScanSequence SequenceOf(const StudyLog& log) {
  ScanSequence sequence;
  sequence.name = log.name;
  for (const LogRecord& record : log.records) {
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr || !ValidateScan(*scan)) continue;
    const auto truth = std::lower_bound(log.truth.begin(), log.truth.end(), scan->stamp,
                                        [](const auto& pose, Stamp stamp) { return pose.stamp < stamp; });
    if (!log.truth.empty() && (truth == log.truth.end() || truth->stamp != scan->stamp)) continue;
    if (!log.truth.empty()) sequence.T_map_robot.push_back(truth->T_map_robot);
    sequence.scans.push_back(*scan);
    sequence.points.emplace_back();
    for (const slam::BeamPoint& hit : slam::PointsOf(*scan)) sequence.points.back().push_back(hit.p_robot);
  }
  return sequence;
}

SequenceErrors MatchSequence(const ScanSequence& sequence, const slam::NdtDeOptions& options) {
  SequenceErrors errors;
  slam::MatchPrior nothing_known;
  nothing_known.covariance = Eigen::Vector3d(1e4, 1e4, 1e2).asDiagonal();
  const Stopwatch watch;
  for (std::size_t i = 1; i < sequence.points.size(); ++i) {
    StepError step;
    step.match = slam::SearchNdt(sequence.points[i - 1], sequence.points[i], nothing_known, options, slam::SerialFor);
    step.T_prev_curr = options.climb ? step.match.result.T_ref_curr : step.match.T_evolved;
    if (!sequence.T_map_robot.empty()) {
      const Pose2 truth = Between(sequence.T_map_robot[i - 1], sequence.T_map_robot[i]);
      step.error = step.T_prev_curr.vector() - truth.vector();
      step.error.z() = WrapAngle(step.error.z());
    }
    errors.steps.push_back(step);
  }
  errors.cpu_ms = watch.CpuMs() / static_cast<double>(std::max<std::size_t>(errors.steps.size(), 1));
  return errors;
}

std::vector<double> SequenceErrors::metres() const {
  std::vector<double> values;
  for (const StepError& step : steps) values.push_back(step.metres());
  return values;
}

std::vector<double> SequenceErrors::degrees() const {
  std::vector<double> values;
  for (const StepError& step : steps) values.push_back(step.degrees());
  return values;
}

std::vector<double> SequenceErrors::fitness() const {
  std::vector<double> values;
  for (const StepError& step : steps) values.push_back(step.match.fitness);
  return values;
}

int SequenceErrors::lost() const {
  return static_cast<int>(std::count_if(steps.begin(), steps.end(), [](const StepError& step) { return step.lost(); }));
}

slam::NdtDeOptions ThesisOptions(std::uint64_t seed) {
  slam::NdtDeOptions options;
  options.seed = static_cast<std::int64_t>(seed);
  options.climb = false;
  // The thesis accepts every answer of the evolution.
  options.evidence.min_score = 0.0;
  options.evidence.min_inliers = 1;
  return options;
}

std::vector<Pose2> ChainOf(const SequenceErrors& errors) {
  std::vector<Pose2> poses{Pose2{}};
  for (const StepError& step : errors.steps) poses.push_back(poses.back() * step.T_prev_curr);
  return poses;
}

ScanSequence SimulatedDrive(StudyContext& context, double noise_m) {
  sim::FleetOptions options;
  options.robots = 1;
  options.scan_hz = 5.0;
  options.seed = context.seed;
  options.laser = Sick(noise_m);
  options.drive.speed_m_s = 0.9;
  // At most 17 degrees between two scans, which lies within the search space of Table 4.4.
  options.drive.turn_rad_s = 1.2;
  const int scans = context.Pick(366, 80);
  return SequenceOf(SimulateLog("office", scans / options.scan_hz, options));
}

}  // namespace cairn::studies
