#include "server/slam/scan/odometry_pairing.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/sensor/odometry_continuity.h"
#include "server/slam/scan/deskew.h"

namespace cairn::slam {
namespace {

// The time assumed between the last scan of a clock and the first one after the clock was set back, because the true
// time is not known.
constexpr Stamp kIntervalNs = kNanosPerSecond / 10;
// The speed at a scan is that since so long before it, from odometry of at most such distances in time, with so many
// samples since the scan before.
constexpr std::uint64_t kRateReachNs = kNanosPerSecond / 10, kDenseNs = 60 * kNanosPerSecond / 1000;
constexpr int kFewestSamples = 3;

std::uint64_t Nanos(double seconds) {
  return static_cast<std::uint64_t>(seconds * 1e9);
}

Pose2 PoseAt(Stamp stamp, const Odometry& before, const Odometry& after) {
  const auto gap = static_cast<double>(NanosBetween(before.stamp, after.stamp));
  return Interpolate(before.T_odom_robot, after.T_odom_robot,
                     static_cast<double>(NanosBetween(before.stamp, stamp)) / gap);
}

// A scan whose beams were measured one after the other is replaced by one that was taken at its stamp.
std::shared_ptr<const Scan> WithoutMotion(const std::shared_ptr<const Scan>& scan, const std::vector<Odometry>& during,
                                          const DeskewOptions& options) {
  if (during.empty()) return scan;
  // Where the robot has turned away from everything that was hit, nothing would be left of the scan.
  auto still = std::make_shared<const Scan>(Deskew(*scan, during, options));
  return ValidateScan(*still) ? still : scan;
}

}  // namespace

void Visit(OptionVisitor& visitor, PairingOptions& options) {
  visitor.Real("max_gap_s", options.max_gap_s, "s", 0.01, 60.0,
               "Longest time between the two odometry samples around a scan. With a longer one the scan is dropped.");
  visitor.Real(
      "max_stamp_jump_s", options.max_stamp_jump_s, "s", 0.1, 1e7,
      "A time stamp that is farther ahead of the last one is held back until jump_confirmations of them agree.");
  visitor.Integer(
      "jump_confirmations", options.jump_confirmations, "stamps", 2, 1000,
      "Number of time stamps in a row that agree on a new time, ahead or back, after which the clock counts "
      "as changed.");
  visitor.Integer(
      "max_waiting_scans", options.max_waiting_scans, "scans", 1, 10000,
      "Scans that may wait for odometry. When there are more, the oldest is dropped. A scan whose beams were "
      "measured one after the other waits until there is odometry at its last beam.");
  visitor.Real("no_odometry_after_s", options.no_odometry_after_s, "s", 0.1, 1e7,
               "When the first scans have waited for the first odometry for so long, by their stamps, and in a "
               "server by its clock, the robot counts as one without odometry, and is mapped from its scans alone "
               "until it sends some.");
  visitor.Integer(
      "no_odometry_after_scans", options.no_odometry_after_scans, "scans", 2, 10000,
      "The same after so many waiting scans, whatever their time. A client that bounds how far it runs ahead "
      "must allow at least so many.");
  visitor.Integer(
      "max_odometry", options.max_odometry, "samples", 2, 100000,
      "Odometry samples that are kept for later scans. When there are more, the oldest is dropped. They must "
      "cover the longest scan: a scan of 1 s with odometry at 100 Hz needs more than 100.");
  visitor.Real(
      "max_pause_s", options.max_pause_s, "s", 0.1, 1e7,
      "After a longer time between two scans the robot counts as localized only if its scan agrees with its "
      "map where odometry says that it is. After more than 10 s it has to be found in its map. Within a longer "
      "time somebody may carry the robot to another place without being noticed.");
  visitor.Real("max_speed_m_s", options.max_speed_m_s, "m/s", 0.1, 1000.0,
               "Odometry that moves faster, by a metre or more, has begun anew. The place of the robot is then not "
               "known.");
  visitor.Real("laser_lag_s", options.laser_lag_s, "s", -10.0, 10.0,
               "Scans carry stamps that are later by this than the clock of the odometry says. cairn-calibrate laser "
               "measures it in a log.");
  visitor.Section("wheels", "Corrects odometry whose wheels are not as the robot believes; from cairn-calibrate laser.",
                  [&] {
                    visitor.Real("wheel_scale", options.wheels.wheel_scale, "1", 0.5, 2.0,
                                 "True way over the way that odometry reports.");
                    visitor.Real("turn_scale", options.wheels.turn_scale, "1", 0.5, 2.0,
                                 "True turn over the turn that odometry reports.");
                    visitor.Real("turn_per_m", options.wheels.turn_per_m, "rad/m", -1.0, 1.0,
                                 "Turn to the left for each metre that odometry does not notice, because one wheel is "
                                 "larger than the other.");
                  });
  visitor.Section("rolling", "Scans whose beams were measured one after the other.",
                  [&] { Visit(visitor, options.rolling); });
  visitor.Require(options.max_gap_s <= options.max_stamp_jump_s, "max_gap_s", "must not exceed", "max_stamp_jump_s");
}

OdometryPairing::OdometryPairing(const PairingOptions& options, Sink sink)
    : options_(options),
      sink_(std::move(sink)),
      scan_gate_(Nanos(options.max_stamp_jump_s), static_cast<std::size_t>(options.jump_confirmations),
                 {.pass = [this](std::shared_ptr<const Scan>&& scan) { Take(std::move(scan)); },
                  .refuse = [this](const std::shared_ptr<const Scan>& scan,
                                   DropReason reason) { sink_.dropped(*scan, reason); },
                  .set_back = [this](Stamp last) { ScanClockSetBack(last); }}),
      odometry_gate_(Nanos(options.max_stamp_jump_s), static_cast<std::size_t>(options.jump_confirmations),
                     {.pass = [this](Odometry&& odometry) { Take(odometry); },
                      .refuse = [this](const Odometry&, DropReason) { ++odometry_refused_; },
                      .set_back = [this](Stamp last) { OdometryClockSetBack(last); }}) {}

void OdometryPairing::Add(std::shared_ptr<const Scan> scan) {
  const Scan& sample = *scan;
  scan_gate_.Add(sample.stamp, sample.sequence, std::move(scan));
}

void OdometryPairing::Add(const Odometry& odometry) {
  Odometry sample = odometry;
  // Unsigned, because a broken clock may be anywhere in int64.
  sample.stamp = static_cast<Stamp>(static_cast<std::uint64_t>(odometry.stamp) +
                                    static_cast<std::uint64_t>(StampFromSeconds(options_.laser_lag_s)));
  odometry_gate_.Add(sample.stamp, sample.sequence, Odometry(sample));
}

// Step by step, because the errors of the wheels grow with the way.
Odometry OdometryPairing::Corrected(const Odometry& odometry) {
  Odometry corrected = odometry;
  if (logged_) {
    corrected_ = corrected_ * options_.wheels.Apply(Between(*logged_, odometry.T_odom_robot));
  } else {
    corrected_ = odometry.T_odom_robot;
  }
  logged_ = odometry.T_odom_robot;
  corrected.T_odom_robot = corrected_;
  return corrected;
}

void OdometryPairing::NewClient() {
  BeginAnew(Passage::kUnwatched);
  scan_gate_.NewClient();
  odometry_gate_.NewClient();
}

void OdometryPairing::Take(std::shared_ptr<const Scan>&& scan) {
  scans_.push_back(std::move(scan));
  Flush();
  if (without_odometry() || WaitsInVain()) PairWithoutOdometry();
  if (scans_.size() > static_cast<std::size_t>(options_.max_waiting_scans)) {
    const auto oldest = std::move(scans_.front());
    scans_.pop_front();
    sink_.dropped(*oldest, DropReason::kNoOdometry);
  }
}

// Whether the first scans have waited long enough for the first odometry.
bool OdometryPairing::WaitsInVain() const {
  if (newest_ || scans_.empty()) return false;
  return scans_.size() >= static_cast<std::size_t>(options_.no_odometry_after_scans) ||
         NanosBetween(scans_.front()->stamp, scans_.back()->stamp) >= Nanos(options_.no_odometry_after_s);
}

// REQUIRES: there has been no odometry.
void OdometryPairing::PairWithoutOdometry() {
  for (const auto& scan : std::exchange(scans_, {})) {
    std::vector<Odometry> stands;
    if (const std::uint64_t duration_ns = DurationNs(*scan); duration_ns > 0) {
      const auto end = static_cast<Stamp>(static_cast<std::uint64_t>(scan->stamp) + duration_ns);
      stands = {{.sequence = 0, .stamp = scan->stamp, .T_odom_robot = {}},
                {.sequence = 0, .stamp = end, .T_odom_robot = {}}};
    }
    Hand(scan, std::move(stands), {}, {}, false);
  }
}

void OdometryPairing::Take(const Odometry& sample) {
  if (without_odometry()) Note(Passage::kOdometryBegan);
  Odometry odometry = Corrects() ? Corrected(sample) : sample;
  if (newest_ && !Follows(odometry, sample.T_odom_robot)) {
    BeginAnew(Passage::kUnknown);
    odometry.T_odom_robot = corrected_ = sample.T_odom_robot;  // No wheel has turned for this step.
  }
  newest_ = odometry;
  time_known_ = true;
  odometry_.push_back(odometry);
  // Flush runs before a sample is dropped, because a waiting scan may need the oldest samples.
  Flush();
  if (odometry_.size() > static_cast<std::size_t>(options_.max_odometry)) odometry_.pop_front();
}

// The two streams notice one after the other that the clock was set back. What the other one has sent meanwhile belongs
// to the new time, if it lies well before the old one, and stays: a client that sends no more odometry until some scans
// have been used would wait for ever.
void OdometryPairing::ScanClockSetBack(Stamp last) {
  if (!odometry_gate_.IsBefore(last, Nanos(options_.max_gap_s))) return BeginAnew(Passage::kUnwatched);
  DropWaitingScans();
  Note(Passage::kUnwatched);
}

void OdometryPairing::OdometryClockSetBack(Stamp last) {
  if (!scan_gate_.IsBefore(last, Nanos(options_.max_gap_s))) return BeginAnew(Passage::kUnwatched);
  odometry_.clear();
  Note(Passage::kUnwatched);
  time_known_ = false;
}

void OdometryPairing::DropWaitingScans() {
  for (const auto& scan : std::exchange(scans_, {})) sink_.dropped(*scan, DropReason::kNoOdometry);
}

// What came before cannot be joined with what comes now.
void OdometryPairing::BeginAnew(Passage passage) {
  DropWaitingScans();
  odometry_.clear();
  Note(passage);
  time_known_ = false;
}

// Adds it to what lies between the last pair and the next one.
void OdometryPairing::Note(Passage passage) {
  const bool began = passage_ == Passage::kOdometryBegan || passage == Passage::kOdometryBegan;
  const bool alone = passage_ == Passage::kDriven || passage == Passage::kDriven || passage_ == passage;
  passage_ = began && !alone ? Passage::kUnknown : std::max(passage_, passage);
}

// Whether this may be the odometry of the same drive as the sample before. `logged`: as it came.
bool OdometryPairing::Follows(const Odometry& odometry, const Pose2& logged) const {
  const DriveLimits limits{options_.max_gap_s, options_.max_speed_m_s, options_.same_place_m,
                           options_.same_heading_rad};
  return GoesOn({.earlier = odometry_.size() >= 2 ? &*std::prev(odometry_.end(), 2) : nullptr,
                 .before = *newest_,
                 .after = odometry,
                 .logged = logged,
                 .time_known = time_known_},
                limits);
}

void OdometryPairing::Pair(const std::shared_ptr<const Scan>& scan, const Pose2& T_odom_robot, const Pose2& rate) {
  Hand(scan, During(*scan), T_odom_robot, rate, true);
}

// Gives the pair to the sink.
void OdometryPairing::Hand(const std::shared_ptr<const Scan>& scan, std::vector<Odometry> during,
                           const Pose2& T_odom_robot, const Pose2& rate, bool has_odometry) {
  // Unsigned, because a broken clock may be anywhere in int64.
  const auto robot_time = static_cast<std::uint64_t>(scan->stamp);
  auto stamp = static_cast<Stamp>(robot_time + set_back_ns_);
  if (last_paired_ && stamp <= *last_paired_) {
    stamp = static_cast<Stamp>(static_cast<std::uint64_t>(*last_paired_) + kIntervalNs);
    set_back_ns_ = static_cast<std::uint64_t>(stamp) - robot_time;
  }
  if (last_paired_ && NanosBetween(*last_paired_, stamp) > Nanos(options_.max_pause_s)) Note(Passage::kPaused);
  // Before the first pair nothing is known that could be lost.
  if (!last_paired_) passage_ = Passage::kDriven;
  last_paired_ = stamp;
  sink_.paired({scan, WithoutMotion(scan, during, options_.rolling.deskew), T_odom_robot, stamp,
                std::exchange(passage_, Passage::kDriven), std::move(during), rate, has_odometry});
}

void OdometryPairing::SetLag(double lag_s) {
  lag_ns_ = StampFromSeconds(std::clamp(lag_s, -kMostLagS, kMostLagS));
}

// Unsigned, because a broken clock may be anywhere in int64.
Stamp OdometryPairing::TimeOf(const Scan& scan) const {
  return static_cast<Stamp>(static_cast<std::uint64_t>(scan.stamp) - static_cast<std::uint64_t>(lag_ns_));
}

// Only from dense odometry between the scans: where it comes with the scans alone, their stamps come in bursts, and no
// lag between the two can be seen. Zero if it is not known. From samples at and before the first one after `time`, so
// that it does not matter how much has arrived since.
Pose2 OdometryPairing::RateAt(Stamp time) const {
  const auto after = std::lower_bound(odometry_.begin(), odometry_.end(), time,
                                      [](const Odometry& odometry, Stamp stamp) { return odometry.stamp < stamp; });
  if (after == odometry_.end() || !last_paired_) return {};
  const auto last = static_cast<Stamp>(static_cast<std::uint64_t>(*last_paired_) - set_back_ns_ -
                                       static_cast<std::uint64_t>(lag_ns_));
  auto before = after;
  int since_last = 1;
  while (before->stamp > time || NanosBetween(before->stamp, time) < kRateReachNs) {
    if (before == odometry_.begin()) return {};
    const auto earlier = std::prev(before);
    since_last += earlier->stamp > last ? 1 : 0;
    if (NanosBetween(earlier->stamp, before->stamp) > kDenseNs) return {};
    before = earlier;
  }
  if (since_last < kFewestSamples) return {};
  const Pose2 step = Between(before->T_odom_robot, after->T_odom_robot);
  const double per_s = 1e9 / static_cast<double>(NanosBetween(before->stamp, after->stamp));
  return {step.x * per_s, step.y * per_s, step.theta * per_s};
}

// Whether odometry covers the whole scan.
bool OdometryPairing::Covers(const Scan& scan) const {
  const Stamp time = TimeOf(scan);
  if (odometry_.empty() || odometry_.back().stamp < time) return false;
  return NanosBetween(time, odometry_.back().stamp) >= DurationNs(scan);
}

// Pairs a scan that has odometry at or after its stamp, or drops it.
void OdometryPairing::PairOrDrop(const std::shared_ptr<const Scan>& scan) {
  const Stamp time = TimeOf(*scan);
  const auto after = std::lower_bound(odometry_.begin(), odometry_.end(), time,
                                      [](const Odometry& odometry, Stamp stamp) { return odometry.stamp < stamp; });
  const bool exact = after->stamp == time;
  if (!exact && after == odometry_.begin()) return sink_.dropped(*scan, DropReason::kNoOdometry);
  const auto before = exact ? after : std::prev(after);
  const bool too_far = !exact && NanosBetween(before->stamp, after->stamp) > Nanos(options_.max_gap_s);
  const Pose2 T_odom_robot = exact ? after->T_odom_robot : PoseAt(time, *before, *after);
  const Pose2 rate = RateAt(time);
  // Later scans have later stamps, so nothing before this sample is needed any more, but the one before it, which says
  // how the robot moves (Follows), and as much as the lag may grow.
  while (odometry_.size() > 2 && odometry_[1].stamp < before->stamp &&
         NanosBetween(odometry_[1].stamp, before->stamp) > Nanos(kMostLagS))
    odometry_.pop_front();
  const std::vector<Odometry> during = During(*scan);
  const auto apart = [this](const Odometry& a, const Odometry& b) {
    return NanosBetween(a.stamp, b.stamp) > Nanos(options_.max_gap_s);
  };
  if (too_far || std::adjacent_find(during.begin(), during.end(), apart) != during.end())
    return sink_.dropped(*scan, DropReason::kNoOdometry);
  Pair(scan, T_odom_robot, rate);
}

// The odometry from the last sample at or before the stamp of a scan to its last beam; nothing if the scan was taken at
// once.
std::vector<Odometry> OdometryPairing::During(const Scan& scan) const {
  const std::uint64_t duration_ns = DurationNs(scan);
  std::vector<Odometry> during;
  const Stamp time = TimeOf(scan);
  if (duration_ns == 0 || odometry_.empty() || odometry_.front().stamp > time) return during;
  const auto later = [](Stamp stamp, const Odometry& odometry) { return stamp < odometry.stamp; };
  for (auto at = std::prev(std::upper_bound(odometry_.begin(), odometry_.end(), time, later)); at != odometry_.end();
       ++at) {
    during.push_back(*at);
    // On the clock of the scan.
    during.back().stamp =
        static_cast<Stamp>(static_cast<std::uint64_t>(at->stamp) + static_cast<std::uint64_t>(lag_ns_));
    if (at->stamp >= time && NanosBetween(time, at->stamp) >= duration_ns) break;
  }
  return during;
}

void OdometryPairing::Flush() {
  while (!scans_.empty() && Covers(*scans_.front())) {
    const auto scan = std::move(scans_.front());
    scans_.pop_front();
    PairOrDrop(scan);
  }
}

void OdometryPairing::Finish() {
  odometry_gate_.Finish();
  scan_gate_.Finish();
  Flush();
  if (!newest_) PairWithoutOdometry();
  while (!scans_.empty()) {
    const auto scan = std::move(scans_.front());
    scans_.pop_front();
    // After Flush only scans are left that end later than the last odometry sample.
    const Stamp time = TimeOf(*scan);
    if (!odometry_.empty() && odometry_.back().stamp >= time) {
      PairOrDrop(scan);
    } else if (!odometry_.empty() && NanosBetween(odometry_.back().stamp, time) <= Nanos(options_.max_gap_s)) {
      Pair(scan, odometry_.back().T_odom_robot, {});
    } else {
      sink_.dropped(*scan, DropReason::kNoOdometry);
    }
  }
}

}  // namespace cairn::slam
