#include "server/slam/tracking/scan_tracking.h"

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "server/slam/scan/deskew.h"
#include "server/slam/scan/stamp_gate.h"

namespace cairn::slam {
namespace {

// A speed that is older than this is not used.
constexpr double kLongestS = 1.0;
// A scan is computed anew if its last beam moves by so much: a beam of a cheap lidar, and its noise.
constexpr double kWorthwhileM = 0.01;
constexpr double kWorthwhileRad = 0.01;
// The step to a scan with the wrong motion in it is itself wrong by up to half of the error of that motion, so that the
// first look halves the error only.
constexpr int kMostLooks = 4;

struct TimedStep {
  Pose2 step;
  double seconds = 0.0;
};

Pose2 PlaceOf(const Trail& trail, const MapperSnapshot::ScanPlace& place) {
  return trail.shapes()[place.keyframe].T_track_robot * place.T_keyframe_robot;
}

std::optional<TimedStep> StepBetween(Stamp earlier, const Pose2& T_track_earlier, Stamp later,
                                     const Pose2& T_track_later) {
  const double seconds = 1e-9 * static_cast<double>(NanosBetween(earlier, later));
  if (seconds <= 0.0 || seconds > kLongestS) return std::nullopt;
  return TimedStep{Between(T_track_earlier, T_track_later), seconds};
}

std::optional<TimedStep> LastStep(const Trail& trail) {
  const auto& scans = trail.scans();
  if (scans.size() < 2) return std::nullopt;
  const auto &before = scans[scans.size() - 2], &last = scans.back();
  return StepBetween(before.stamp, PlaceOf(trail, before), last.stamp, PlaceOf(trail, last));
}

// Null if nothing would be left of the scan.
std::shared_ptr<const Scan> Computed(const RollingScan& rolling, const std::vector<Odometry>& motion, Stamp stamp) {
  Scan scan = Deskew(*rolling.scan, motion);
  if (!ValidateScan(scan)) return nullptr;
  scan.stamp = stamp;  // The estimator's time.
  return std::make_shared<const Scan>(std::move(scan));
}

std::vector<Odometry> Forecast(const Scan& scan, const std::optional<TimedStep>& last) {
  return last ? AtConstantVelocity(scan, last->step, last->seconds) : AtConstantVelocity(scan, {}, 1.0);
}

// The motion within the scan, if the robot moves on as from the scan before to the pose that was matched. Nothing if
// the match does not say.
std::optional<std::vector<Odometry>> MatchedMotion(const FrontEnd& front_end, const FrontEndOptions& options,
                                                   const Trail& trail, const RollingScan& rolling,
                                                   const TrackedScan& tracked) {
  if (trail.scans().empty() || !tracked.step.matched || tracked.step.degenerate) return std::nullopt;
  const auto& last = trail.scans().back();
  const auto step = StepBetween(last.stamp, PlaceOf(trail, last), tracked.scan->stamp, tracked.step.T_track_robot);
  const auto odometry_step = front_end.LastOdometryStep();
  if (!step || !odometry_step) return std::nullopt;
  return options.use_odometry ? CorrectedMotion(rolling, step->step, *odometry_step, step->seconds)
                              : AtConstantVelocity(*rolling.scan, step->step, step->seconds);
}

// Where the match shows another motion, the scan is computed with it and aligned again.
void LookAgain(FrontEnd& front_end, const FrontEndOptions& options, const Trail& trail, const RollingScan& rolling,
               std::vector<Odometry> motion, const Pose2& T_odom_robot, TrackedScan& tracked) {
  for (int look = 0; look < kMostLooks; ++look) {
    auto matched = MatchedMotion(front_end, options, trail, rolling, tracked);
    if (!matched) return;
    const Pose2 change = DifferenceAtTheEnd(motion, *matched);
    if (change.translation().norm() < kWorthwhileM && std::abs(change.theta) < kWorthwhileRad) return;
    motion = std::move(*matched);
    auto scan = Computed(rolling, motion, tracked.scan->stamp);
    if (scan == nullptr) return;
    ScanView view = Look(*scan, options);
    const auto again = front_end.TrackAgain(view, T_odom_robot, tracked.step);
    if (!again) return;
    tracked = {std::move(scan), std::move(view), *again};
  }
}

}  // namespace

TrackedScan TrackScan(FrontEnd& front_end, const FrontEndOptions& options, const Trail& trail,
                      std::shared_ptr<const Scan> scan, const RollingScan* rolling, const Pose2& T_odom_robot,
                      const ParallelFor& parallel_for) {
  std::vector<Odometry> motion;
  if (rolling != nullptr) {
    motion = options.use_odometry ? rolling->odometry : Forecast(*rolling->scan, LastStep(trail));
    if (!options.use_odometry)
      if (auto forecast = Computed(*rolling, motion, scan->stamp)) scan = std::move(forecast);
  }
  ScanView view = Look(*scan, options);
  const TrackStep step = front_end.Track(view, T_odom_robot, parallel_for);
  TrackedScan tracked{std::move(scan), std::move(view), step};
  if (rolling != nullptr) LookAgain(front_end, options, trail, *rolling, std::move(motion), T_odom_robot, tracked);
  return tracked;
}

}  // namespace cairn::slam
