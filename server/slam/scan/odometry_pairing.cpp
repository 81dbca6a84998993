#include "server/slam/scan/odometry_pairing.h"

#include <algorithm>
#include <utility>

namespace cairn::slam {
namespace {

// later - earlier without overflow, for stamps a broken clock may place anywhere in int64.
std::uint64_t NanosBetween(Stamp earlier, Stamp later) {
  return static_cast<std::uint64_t>(later) - static_cast<std::uint64_t>(earlier);
}

std::uint64_t Nanos(double seconds) {
  return static_cast<std::uint64_t>(seconds * 1e9);
}

Pose2 PoseAt(Stamp stamp, const Odometry& before, const Odometry& after) {
  const auto gap = static_cast<double>(NanosBetween(before.stamp, after.stamp));
  return Interpolate(before.T_odom_robot, after.T_odom_robot,
                     static_cast<double>(NanosBetween(before.stamp, stamp)) / gap);
}

}  // namespace

void Visit(OptionVisitor& visitor, PairingOptions& options) {
  visitor.Real("max_gap_s", options.max_gap_s, "s", 0.01, 60.0,
               "odometry samples around a scan may be this far apart; longer gaps drop the scan");
  visitor.Real("max_stamp_jump_s", options.max_stamp_jump_s, "s", 1.0, 1e7,
               "a stamp further ahead of the last is refused until the clock proves itself");
  visitor.Integer("jump_confirmations", options.jump_confirmations, "stamps", 1, 1000,
                  "consecutive stamps near a new time that prove a changed clock");
  visitor.Integer("max_waiting_scans", options.max_waiting_scans, "scans", 1, 10000,
                  "scans that may wait for odometry; more: the oldest is dropped");
  visitor.Integer("max_odometry", options.max_odometry, "samples", 2, 100000,
                  "odometry samples kept for scans to come; more: the oldest goes");
}

std::optional<DropReason> OdometryPairing::StampGate::Check(Stamp stamp, const PairingOptions& options) {
  if (has_last && stamp == last) return DropReason::kDuplicateStamp;
  if (has_last && stamp < last) return DropReason::kStampWentBack;
  const std::uint64_t max_jump = Nanos(options.max_stamp_jump_s);
  if (has_last && NanosBetween(last, stamp) > max_jump) {
    const bool agrees = agreeing > 0 && stamp > candidate && NanosBetween(candidate, stamp) <= max_jump;
    agreeing = agrees ? agreeing + 1 : 1;
    candidate = stamp;
    if (agreeing < options.jump_confirmations) return DropReason::kStampJump;
  }
  has_last = true;
  last = stamp;
  agreeing = 0;
  return std::nullopt;
}

OdometryPairing::OdometryPairing(const PairingOptions& options, Sink sink)
    : options_(options), sink_(std::move(sink)) {}

void OdometryPairing::Add(std::shared_ptr<const Scan> scan) {
  if (const auto reason = scan_gate_.Check(scan->stamp, options_)) {
    sink_.dropped(*scan, *reason);
    return;
  }
  scans_.push_back(std::move(scan));
  Flush();
  if (scans_.size() > static_cast<std::size_t>(options_.max_waiting_scans)) {
    const auto oldest = std::move(scans_.front());
    scans_.pop_front();
    sink_.dropped(*oldest, DropReason::kNoOdometry);
  }
}

bool OdometryPairing::Add(const Odometry& odometry) {
  if (odometry_gate_.Check(odometry.stamp, options_)) return false;
  odometry_.push_back(odometry);
  // Before anything is let go: the oldest samples are those a waiting scan may need.
  Flush();
  // Poses are absolute, so leaving out the oldest loses no motion.
  if (odometry_.size() > static_cast<std::size_t>(options_.max_odometry)) odometry_.pop_front();
  return true;
}

void OdometryPairing::Flush() {
  while (!scans_.empty() && !odometry_.empty() && odometry_.back().stamp >= scans_.front()->stamp) {
    const auto scan = std::move(scans_.front());
    scans_.pop_front();
    const auto after = std::lower_bound(odometry_.begin(), odometry_.end(), scan->stamp,
                                        [](const Odometry& odometry, Stamp stamp) { return odometry.stamp < stamp; });
    if (after->stamp == scan->stamp) {
      // Scans still to come are later: nothing before this sample is needed any more.
      const Pose2 T_odom_robot = after->T_odom_robot;
      odometry_.erase(odometry_.begin(), after);
      sink_.paired({scan, T_odom_robot});
      continue;
    }
    if (after == odometry_.begin()) {
      sink_.dropped(*scan, DropReason::kNoOdometry);
      continue;
    }
    const auto before = std::prev(after);
    const bool too_far = NanosBetween(before->stamp, after->stamp) > Nanos(options_.max_gap_s);
    const Pose2 T_odom_robot = PoseAt(scan->stamp, *before, *after);
    odometry_.erase(odometry_.begin(), before);
    if (too_far) {
      sink_.dropped(*scan, DropReason::kNoOdometry);
    } else {
      sink_.paired({scan, T_odom_robot});
    }
  }
}

void OdometryPairing::Finish() {
  Flush();
  while (!scans_.empty()) {
    const auto scan = std::move(scans_.front());
    scans_.pop_front();
    // Flush has left only scans later than the last odometry.
    if (!odometry_.empty() && NanosBetween(odometry_.back().stamp, scan->stamp) <= Nanos(options_.max_gap_s)) {
      sink_.paired({scan, odometry_.back().T_odom_robot});
    } else {
      sink_.dropped(*scan, DropReason::kNoOdometry);
    }
  }
}

}  // namespace cairn::slam
