// Gives every scan the odometry pose at its stamp, independently of the order in which the two streams
// arrive: a scan waits until there is a sample at or after its last beam, and then gets an interpolated pose; where its
// beams were measured one after the other, the motion meanwhile is taken out of it (deskew.h), and a gap
// in the odometry until its last beam counts as one at its stamp. All decisions depend on stamps alone, so the same two
// streams give the same pairs however they interleave, as long as no bound is reached and no clock is set back. When a
// clock is set back, waiting scans are dropped, because scans and odometry of two clocks cannot be joined; the time of
// the estimator still grows (PairedScan::stamp). It also says what lies between a pair and the one before it (Passage):
// a pause, and odometry that cannot be that of one drive. Odometry is used on the clock of the scans, and corrected for
// the wheels of the robot, as the options say. Memory is bounded. Not thread-safe.
//
// A robot that sends no odometry: when scans have waited for the first sample as long as the options say, they and all
// later ones are paired without odometry (PairedScan::has_odometry), as soon as they come. From the first sample on,
// scans are paired with odometry again; the first one that is says so (Passage::kOdometryBegan).
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/sensor/odometry.h"
#include "common/sensor/scan.h"
#include "common/service/ledger.h"
#include "server/slam/scan/scan_motion.h"
#include "server/slam/scan/stamp_gate.h"
#include "server/slam/scan/wheel_correction.h"

namespace cairn::slam {

struct PairingOptions {
  double max_gap_s = 2.0;
  double max_stamp_jump_s = 10.0;
  std::int64_t jump_confirmations = 5;
  std::int64_t max_waiting_scans = 64;
  double no_odometry_after_s = 2.0;
  std::int64_t no_odometry_after_scans = 30;  // Below the window of a client, which else waits for the server.
  std::int64_t max_odometry = 1024;           // A scan that takes longer than so many samples cannot be used.
  double max_pause_s = 2.0;
  double max_speed_m_s = 3.0;
  // No keys of the configuration: DriveLimits.
  double same_place_m = 1.0;
  double same_heading_rad = 1.0;
  RollingOptions rolling{};
  // What cairn-calibrate laser has found of the robot.
  double laser_lag_s = 0.0;
  WheelCorrection wheels{};
};
void Visit(OptionVisitor& visitor, PairingOptions& options);

// What lies between a scan and the one before it. Where several of the first four apply, the last of them counts. Where
// kOdometryBegan and another one but kDriven apply, kUnknown counts.
enum class Passage : std::uint8_t {
  kDriven = 0,  // The robot was watched all the way.
  kPaused,      // Scans are missing for some time. Odometry says how the robot moved, if nobody carried it.
  kUnwatched,   // As kPaused, but its length is unknown, or another client continues.
  kUnknown,     // The odometry began anew or jumped: nothing says where the robot is now.
  // As kDriven, but this is the first scan with odometry after others without.
  kOdometryBegan,
};

struct PairedScan {
  std::shared_ptr<const Scan> scan;      // As it was added.
  std::shared_ptr<const Scan> at_stamp;  // The same with all beams at its stamp, for estimation.
  Pose2 T_odom_robot;
  Stamp stamp = 0;  // The scan's, plus what the robot's clock was set back by: grows from pair to pair.
  Passage passage = Passage::kDriven;
  std::vector<Odometry> during{};  // RollingScan::odometry; empty if all beams are measured at once.
  // Speed at the stamp, as odometry shows it: per second, in the frame of the robot. Zero where odometry between the
  // scans is too sparse to show it.
  Pose2 rate{};
  bool has_odometry = true;  // Otherwise T_odom_robot is the identity, and `during` says that the robot stands.
};

class OdometryPairing {
 public:
  struct Sink {
    std::function<void(PairedScan&&)> paired;
    std::function<void(const Scan&, DropReason)> dropped;
  };

  OdometryPairing(const PairingOptions& options, Sink sink);
  OdometryPairing(const OdometryPairing&) = delete;
  OdometryPairing& operator=(const OdometryPairing&) = delete;

  // Both functions may call the sink, for this scan or for waiting ones, in the order of their stamps.
  void Add(std::shared_ptr<const Scan> scan);
  void Add(const Odometry& odometry);
  // From now on both streams come from another client, which numbers from the beginning. Nobody has watched the robot
  // since the last sample, for an unknown time. Scans that still wait for odometry are dropped.
  void NewClient();
  // Whether scans are paired without odometry, because the robot sends none.
  [[nodiscard]] bool without_odometry() const { return last_paired_ && !newest_; }
  // Call this when no more odometry will come. Without any odometry, waiting scans are paired without. A waiting scan
  // that began before the last sample is paired as usual, and the robot is taken to stand after that sample. A later
  // scan is paired with the last sample if that is at most max_gap_s old, and is dropped otherwise.
  void Finish();

  [[nodiscard]] std::size_t waiting() const { return scans_.size(); }
  // Calls visit(scan) for every scan for which the sink has not been called yet.
  template <typename Visit>
  void ForEachWaiting(const Visit& visit) const {
    for (const auto& scan : scans_) visit(*scan);
    scan_gate_.ForEachHeld([&visit](const std::shared_ptr<const Scan>& scan) { visit(*scan); });
  }
  // From the next scan on, stamps of scans count as later by this than those of odometry, in addition to
  // PairingOptions::laser_lag_s. At most kMostLagS either way: so much odometry is kept.
  static constexpr double kMostLagS = 1.0;
  void SetLag(double lag_s);
  // The first odometry after scans without it has come, and no scan since then.
  [[nodiscard]] bool odometry_has_just_begun() const { return passage_ == Passage::kOdometryBegan; }
  // Odometry samples refused so far for their stamps.
  [[nodiscard]] std::uint64_t odometry_refused() const { return odometry_refused_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.scans_, self.odometry_, self.last_paired_, self.set_back_ns_, self.odometry_refused_, self.passage_,
            self.newest_, self.time_known_, self.scan_gate_, self.odometry_gate_);
    archive.Require(self.passage_ <= Passage::kOdometryBegan, "a passage");
    if (self.Corrects()) archive(self.logged_, self.corrected_);
    if constexpr (Archive::kReads) {
      self.lag_ns_ = 0;
      if (archive.format() < 12) return;
    }
    archive(self.lag_ns_);
    archive.Require(-kNanosPerSecond <= self.lag_ns_ && self.lag_ns_ <= kNanosPerSecond, "a lag");
  }

 private:
  void Take(std::shared_ptr<const Scan>&& scan);
  void Take(const Odometry& odometry);
  [[nodiscard]] bool Corrects() const { return options_.wheels != WheelCorrection{}; }
  [[nodiscard]] Odometry Corrected(const Odometry& odometry);
  void ScanClockSetBack(Stamp last);
  void OdometryClockSetBack(Stamp last);
  void DropWaitingScans();
  void Note(Passage passage);
  [[nodiscard]] bool WaitsInVain() const;
  void PairWithoutOdometry();
  // The time of the scan on the clock of the odometry.
  [[nodiscard]] Stamp TimeOf(const Scan& scan) const;
  [[nodiscard]] Pose2 RateAt(Stamp time) const;
  [[nodiscard]] bool Covers(const Scan& scan) const;
  void PairOrDrop(const std::shared_ptr<const Scan>& scan);
  [[nodiscard]] std::vector<Odometry> During(const Scan& scan) const;
  void BeginAnew(Passage passage);
  [[nodiscard]] bool Follows(const Odometry& odometry, const Pose2& logged) const;
  void Flush();
  void Pair(const std::shared_ptr<const Scan>& scan, const Pose2& T_odom_robot, const Pose2& rate);
  void Hand(const std::shared_ptr<const Scan>& scan, std::vector<Odometry> during, const Pose2& T_odom_robot,
            const Pose2& rate, bool has_odometry);

  PairingOptions options_;
  Sink sink_;
  std::deque<std::shared_ptr<const Scan>> scans_;
  std::deque<Odometry> odometry_;
  std::optional<Stamp> last_paired_;  // In the estimator's time.
  std::uint64_t set_back_ns_ = 0;     // The estimator's time less the robot's, modulo 2^64.
  std::uint64_t odometry_refused_ = 0;
  Stamp lag_ns_ = 0;                    // SetLag.
  Passage passage_ = Passage::kDriven;  // Since the last pair, as far as it is known.
  std::optional<Odometry> newest_;      // The last sample taken, of any clock or client,
  bool time_known_ = true;              // and whether the time since then is known.
  // Where wheels are corrected: the last pose as it came, and as it is used.
  std::optional<Pose2> logged_;
  Pose2 corrected_;
  StampGate<std::shared_ptr<const Scan>> scan_gate_;
  StampGate<Odometry> odometry_gate_;
};

}  // namespace cairn::slam
