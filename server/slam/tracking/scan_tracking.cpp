#include "server/slam/tracking/scan_tracking.h"

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "server/slam/scan/deskew.h"
#include "server/slam/scan/stamp_gate.h"

namespace cairn::slam {
namespace {

struct TimedStep {
  Pose2 step;
  double seconds = 0.0;
};

Pose2 PlaceOf(const Trail& trail, const MapperSnapshot::ScanPlace& place) {
  return trail.shapes()[place.keyframe].T_track_robot * place.T_keyframe_robot;
}

std::optional<TimedStep> StepBetween(Stamp earlier, const Pose2& T_track_earlier, Stamp later,
                                     const Pose2& T_track_later, double longest_s) {
  const double seconds = 1e-9 * static_cast<double>(NanosBetween(earlier, later));
  if (seconds <= 0.0 || seconds > longest_s) return std::nullopt;
  return TimedStep{Between(T_track_earlier, T_track_later), seconds};
}

std::optional<TimedStep> LastStep(const Trail& trail, double longest_s) {
  const auto& scans = trail.scans();
  if (scans.size() < 2) return std::nullopt;
  const auto &before = scans[scans.size() - 2], &last = scans.back();
  return StepBetween(before.stamp, PlaceOf(trail, before), last.stamp, PlaceOf(trail, last), longest_s);
}

// The same from the front-end, which gets no stamps: scans come at equal intervals.
std::optional<TimedStep> StepSince(const FrontEnd& front_end, const ScanBefore& last, Stamp now, double longest_s) {
  const auto step = front_end.LastStep();
  return step ? StepBetween(last.stamp, {}, now, *step, longest_s) : std::nullopt;
}

// Null if nothing would be left of the scan.
std::shared_ptr<const Scan> Computed(const RollingScan& rolling, const std::vector<Odometry>& motion,
                                     const DeskewOptions& options, Stamp stamp) {
  Scan scan = Deskew(*rolling.scan, motion, options);
  if (!ValidateScan(scan)) return nullptr;
  scan.stamp = stamp;  // The estimator's time.
  return std::make_shared<const Scan>(std::move(scan));
}

std::vector<Odometry> Forecast(const Scan& scan, const std::optional<TimedStep>& last) {
  return last ? AtConstantVelocity(scan, last->step, last->seconds) : AtConstantVelocity(scan, {}, 1.0);
}

// The motion within the scan, if the robot moves on as from the scan before to the pose that was matched. Nothing if
// the match does not say.
std::optional<std::vector<Odometry>> MatchedMotion(const FrontEnd& front_end, const TrackScanOptions& options,
                                                   const std::optional<ScanBefore>& last, const RollingScan& rolling,
                                                   const TrackedScan& tracked) {
  if (!last || !tracked.step.matched || tracked.step.degenerate) return std::nullopt;
  const auto step = StepBetween(last->stamp, last->T_track_robot, tracked.scan->stamp, tracked.step.T_track_robot,
                                options.rolling.longest_s);
  const auto odometry_step = front_end.LastOdometryStep();
  if (!step || !odometry_step) return std::nullopt;
  return options.front_end.use_odometry ? CorrectedMotion(rolling, step->step, *odometry_step, step->seconds)
                                        : AtConstantVelocity(*rolling.scan, step->step, step->seconds);
}

// Where the match shows another motion, the scan is computed with it and aligned again.
void LookAgain(FrontEnd& front_end, const TrackScanOptions& options, const std::optional<ScanBefore>& last,
               const RollingScan& rolling, std::vector<Odometry> motion, const Pose2& T_odom_robot,
               TrackedScan& tracked) {
  const RollingOptions& limits = options.rolling;
  for (std::int64_t look = 0; look < limits.most_looks; ++look) {
    auto matched = MatchedMotion(front_end, options, last, rolling, tracked);
    if (!matched) return;
    const Pose2 change = DifferenceAtTheEnd(motion, *matched);
    if (change.translation().norm() < limits.worthwhile_m && std::abs(change.theta) < limits.worthwhile_rad) return;
    motion = std::move(*matched);
    auto scan = Computed(rolling, motion, limits.deskew, tracked.scan->stamp);
    if (scan == nullptr) return;
    Begin(front_end.watch(), ScanStep::kLook);
    ScanView view = Look(*scan, options.front_end);
    const auto again = front_end.TrackAgain(view, T_odom_robot, tracked.step);
    if (!again) return;
    tracked = {std::move(scan), std::move(view), *again};
  }
}

}  // namespace

TrackedScan TrackScan(FrontEnd& front_end, const TrackScanOptions& options, const Trail& trail,
                      std::shared_ptr<const Scan> scan, const RollingScan* rolling, const Pose2& T_odom_robot,
                      const ParallelFor& parallel_for, std::optional<ScanBefore> last) {
  Begin(front_end.watch(), ScanStep::kLook);
  std::vector<Odometry> motion;
  if (rolling != nullptr) {
    const bool use_odometry = options.front_end.use_odometry;
    const double longest_s = options.rolling.longest_s;
    motion = use_odometry ? rolling->odometry
                          : Forecast(*rolling->scan, last ? StepSince(front_end, *last, scan->stamp, longest_s)
                                                          : LastStep(trail, longest_s));
    if (!use_odometry)
      if (auto forecast = Computed(*rolling, motion, options.rolling.deskew, scan->stamp)) scan = std::move(forecast);
  }
  ScanView view = Look(*scan, options.front_end);
  const TrackStep step = front_end.Track(view, T_odom_robot, parallel_for);
  TrackedScan tracked{std::move(scan), std::move(view), step};
  if (rolling == nullptr) return tracked;
  if (!last && !trail.scans().empty())
    last = ScanBefore{trail.scans().back().stamp, PlaceOf(trail, trail.scans().back())};
  LookAgain(front_end, options, last, *rolling, std::move(motion), T_odom_robot, tracked);
  return tracked;
}

}  // namespace cairn::slam
