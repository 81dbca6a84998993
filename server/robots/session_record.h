// What is known of one session and shown to the world: phase, owner, newest pose, the ledgers of its streams (one per
// sensor, and one of the odometry), its path.
// Written by the door's side (arrivals) and by the estimator's strand (outcomes); read by queries through snapshot().
// Decides when a ledger is due: at most `ledger_rate_hz`, but at once every 8 settled scans and when the queue drains,
// because a client that replays a log waits for the ledger before it sends more.
// Thread rule: any thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "server/robots/robots_options.h"
#include "server/robots/session_snapshot.h"
#include "server/robots/stream_ledger.h"
#include "server/slam/state/archive.h"
#include "server/store/records.h"

namespace cairn::server {

class SessionRecord {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t kMaxSensors = 16;
  static constexpr char kOdometry[] = "odometry";  // The name of the odometry's stream; no sensor may have it.
  static constexpr std::uint64_t kSettledBurst = 8;

  SessionRecord(SessionId id, const SessionRequest& request, const RobotsOptions& options);

  // Sensors the session does not have yet; false where that would be too many.
  bool AddSensors(const std::vector<std::string>& sensors);
  // Goes on with the account of a stream that sent before its session was open.
  void Inherit(NameId sensor_id, StreamLedger&& account);

  [[nodiscard]] bool Has(NameId sensor_id) const;

  // A scan of the owner. All but kNew leave no trace here. kAside: after a restart, earlier ones have to be sent again
  // first (robots.gap_wait_s); this one will come again after them.
  enum class Arrival { kNew, kDuplicate, kAside, kUnknownSensor };
  Arrival ScanReceived(NameId sensor_id, std::uint64_t sequence);
  void ScanDropped(NameId sensor_id, std::uint64_t sequence, DropReason reason);
  // `path_stamp` is the estimator's time, which grows also where the robot's clock was set back: the path is kept by
  // it.
  void ScanUsed(NameId sensor_id, const PoseReport& pose, Stamp path_stamp, bool keyframe, double latency_ms);
  // A scan of a client that does not own the session.
  Arrival ForeignScan(NameId sensor_id, DropReason reason);

  // Odometry of the owner; false for a number that was received before or is left aside, which leaves no trace.
  [[nodiscard]] bool OdometryReceived(std::uint64_t sequence);
  void OdometryUsed(std::uint64_t sequence, Stamp stamp);
  // kQueueFull: the sample was merged into its successor.
  void OdometryDropped(std::uint64_t sequence, DropReason reason);

  // What was received is written to the disk, or is no longer, and then why. Says whether this is news.
  bool SetStored(bool stored, const Status& why = {});
  // These entries of the session's journal are on the disk.
  void Durable(const std::vector<JournalEntry>& entries);
  // Scans that wait in the estimator, by sensor: they are in the journal, those in the queue are not.
  using WaitingScans = std::map<NameId, std::set<std::uint64_t>>;
  // The part of a checkpoint that is kept here; false where the moment does not allow one (StreamLedger::AsJournaled).
  [[nodiscard]] bool Save(slam::StateWriter& writer, const WaitingScans& in_estimator) const;
  // DATA_LOSS: the bytes are damaged; the record must then not be used.
  [[nodiscard]] Result<void> Load(slam::StateReader& reader, const WaitingScans& in_estimator);
  // Everything here was read from the disk; the robot is not back yet.
  void Restored();
  [[nodiscard]] std::vector<std::string> sensors() const;

  void SetLandmarks(std::vector<LandmarkReport> landmarks);
  // Another epoch of the map: the newest pose belongs to it from now on.
  void SetEpoch(std::uint32_t epoch);
  void SetAlive(bool alive);
  // Both leave a session that has ended as it is, and say false: whoever asks may have looked before it ended.
  bool SetPhase(SessionPhase phase, Status status);
  // The robot is back, perhaps as another client process, whose session goes on with this one.
  bool Resume(ClientId client, SessionToken session);

  [[nodiscard]] ClientId owner() const;
  [[nodiscard]] SessionToken token() const;  // The session of the owner; streams of others are not taken.
  [[nodiscard]] bool alive() const;
  [[nodiscard]] SessionPhase phase() const;
  [[nodiscard]] SessionState state() const;
  // How long the session has been suspended at `now`; zero where it is not.
  [[nodiscard]] Clock::duration SuspendedFor(Clock::time_point now) const;
  [[nodiscard]] std::uint32_t epoch() const;
  [[nodiscard]] SessionSnapshot snapshot() const;

  enum class Urgency { kWhenDue, kDrained, kNow };
  [[nodiscard]] std::vector<Ledger> TakeDueLedgers(Clock::time_point now, Urgency urgency);
  // A ledger taken that could not be sent: due again.
  void MarkUnsent(NameId sensor_id);

 private:
  struct Stream {
    StreamLedger account{Ledger{}};
    bool changed = true;
    std::uint64_t settled_when_taken = 0;
    Clock::time_point taken{};
    bool resuming = false;      // After a restart, until the number after the last one comes.
    Clock::time_point aside{};  // When the first sample was left aside.
  };
  // Both callers hold the lock of `self`, which the analysis can not see.
  template <typename Archive>
  static void Members(Archive& archive, auto& self, auto& odometry) CAIRN_NO_THREAD_SAFETY_ANALYSIS;
  bool LeftAside(Stream& stream, std::uint64_t sequence) const;
  Ledger NamesOf(NameId sensor_id, const std::string& sensor) const CAIRN_REQUIRES(mutex_);
  static bool IsDue(const Stream& stream, Clock::time_point now, Urgency urgency, Clock::duration period);
  Ledger TakeLedger(Stream& stream, Clock::time_point now) const CAIRN_REQUIRES(mutex_);
  Ledger LedgerOf(const Stream& stream) const CAIRN_REQUIRES(mutex_);
  Stream* Find(NameId sensor_id) CAIRN_REQUIRES(mutex_);

  const SessionId id_;
  const Clock::duration ledger_period_;
  const Clock::duration gap_wait_;

  mutable Mutex mutex_;
  RobotStatus status_ CAIRN_GUARDED_BY(mutex_);           // Its `ledgers` stay empty: they are made on demand.
  Clock::time_point suspended_ CAIRN_GUARDED_BY(mutex_);  // Since when, where it is suspended.
  std::map<NameId, Stream> streams_ CAIRN_GUARDED_BY(mutex_);
  Stream odometry_ CAIRN_GUARDED_BY(mutex_);
  PoseHistory history_ CAIRN_GUARDED_BY(mutex_);
  std::shared_ptr<const std::vector<LandmarkReport>> landmarks_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::server
