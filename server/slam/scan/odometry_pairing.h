// Gives every scan the odometry at its stamp, whatever the order in which the two streams arrive: scans wait until
// odometry at or after their stamp is there, then get it by interpolation. Decides from stamps alone, so the same two
// streams give the same pairs however they interleave, as long as no bound is hit. Bounded. Not thread-safe.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include "common/options/option_visitor.h"
#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"
#include "common/service/ledger.h"

namespace cairn::slam {

struct PairingOptions {
  double max_gap_s = 2.0;          // Between the two odometry samples around a scan; longer: the scan is dropped.
  double max_stamp_jump_s = 3600;  // Ahead of the stream's last stamp; larger: refused until the clock proves itself.
  std::int64_t jump_confirmations = 10;  // Consecutive stamps near the new time that prove a changed clock.
  std::int64_t max_waiting_scans = 64;   // Scans without odometry yet; more: the oldest is dropped.
  std::int64_t max_odometry = 1024;      // Samples kept; more: the oldest goes (poses are absolute: no motion is lost).
};
void Visit(OptionVisitor& visitor, PairingOptions& options);

struct PairedScan {
  std::shared_ptr<const Scan> scan;
  Pose2 T_odom_robot;
};

class OdometryPairing {
 public:
  struct Sink {
    std::function<void(PairedScan&&)> paired;
    std::function<void(const Scan&, DropReason)> dropped;
  };

  OdometryPairing(const PairingOptions& options, Sink sink);

  // Both may call the sink, for this scan or for ones that waited, in stamp order.
  void Add(std::shared_ptr<const Scan> scan);
  // False where the sample is refused (stamp not after the last one's, or a jump).
  bool Add(const Odometry& odometry);
  // No more odometry will come: scans still waiting are used with the last odometry where it is at most max_gap_s old,
  // else dropped.
  void Finish();

  [[nodiscard]] std::size_t waiting() const { return scans_.size(); }

 private:
  // Refuses stamps that repeat, go back or jump ahead; learns a clock that was set ahead. One set back for good needs
  // a new session: poses already given out cannot be followed by earlier ones.
  struct StampGate {
    bool has_last = false;
    Stamp last = 0;
    std::int64_t agreeing = 0;  // Consecutive stamps that agree on a new time, `candidate` the last of them.
    Stamp candidate = 0;
    std::optional<DropReason> Check(Stamp stamp, const PairingOptions& options);
  };
  void Flush();

  PairingOptions options_;
  Sink sink_;
  StampGate scan_gate_, odometry_gate_;
  std::deque<std::shared_ptr<const Scan>> scans_;
  std::deque<Odometry> odometry_;
};

}  // namespace cairn::slam
