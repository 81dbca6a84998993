// What the server reports about one session: phase, owner, newest pose, the ledgers of its streams (one per
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
#include <optional>
#include <set>
#include <span>
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

  // Adds the sensors that the session does not have yet. Returns false if there would be too many.
  bool AddSensors(const std::vector<std::string>& sensors);
  // Continues the ledger of a stream that sent samples before its session was open.
  void Inherit(NameId sensor_id, StreamLedger&& account);

  [[nodiscard]] bool Has(NameId sensor_id) const;

  // A scan of the owner. Only kNew changes the record. kAside: after a restart, scans before this one must be sent
  // again first (robots.gap_wait_s), or its number is doubtful (StreamLedger::IsDoubtful). The client will send this
  // one again.
  enum class Arrival { kNew, kDuplicate, kAside, kUnknownSensor };
  // What an earlier owner sent, and the journal or the estimator holds, is counted without its number, which may be
  // one of the owner's as well.
  enum class From { kRobot, kJournal };  // The journal is believed.
  Arrival ScanReceived(const StreamId& stream, std::uint64_t sequence, From from = From::kRobot);
  void ScanDropped(const StreamId& stream, std::uint64_t sequence, DropReason reason);
  // `path_stamp` is the estimator's time, which grows also where the robot's clock was set back: the path is kept by
  // it.
  void ScanUsed(const StreamId& stream, const PoseReport& pose, Stamp path_stamp, bool keyframe, double latency_ms);
  // A scan of a client that does not own the session.
  Arrival ForeignScan(NameId sensor_id, DropReason reason);

  // Odometry of the owner. Returns false, and changes nothing, if the number was received before or must be sent again
  // later (see kAside).
  [[nodiscard]] bool OdometryReceived(SessionToken session, std::uint64_t sequence, From from = From::kRobot);
  void OdometryUsed(SessionToken session, std::uint64_t sequence, Stamp stamp);
  // kQueueFull: the sample was merged into its successor.
  void OdometryDropped(SessionToken session, std::uint64_t sequence, DropReason reason);

  // Sets whether received samples are stored, and if not, the reason. Returns whether this is a change.
  bool SetStored(bool stored, const Status& why = {});
  // After SetStored(false): what is received from now on is stored again, together with a checkpoint at this position
  // of the journal that holds all before, also the scans that wait in the estimator. StoredAgain: that is on the disk,
  // and the session counts as stored again; returns whether this is a change. SetStored(false) gives both up.
  using WaitingScans = std::map<NameId, std::set<std::uint64_t>>;
  void BeginStoring(std::uint64_t position, const WaitingScans& in_estimator);
  bool StoredAgain(std::uint64_t position);
  // These entries of the session's journal are on the disk.
  void Durable(const std::vector<JournalEntry>& entries);
  // `in_estimator`: the scans that wait there, by sensor. They are in the journal; those that wait in the queue are
  // not. Writes the record's part of a checkpoint. Returns false if the moment does not allow a checkpoint
  // (StreamLedger::AsJournaled).
  [[nodiscard]] bool Save(slam::StateWriter& writer, const WaitingScans& in_estimator) const;
  // DATA_LOSS: the bytes are damaged; the record must then not be used.
  [[nodiscard]] Result<void> Load(slam::StateReader& reader, const WaitingScans& in_estimator);
  // Called after the record was read from the disk, while the robot is not connected yet. `quiet_since_ms`: what
  // quiet_since_ms said last; 0: not known.
  void Restored(std::uint64_t quiet_since_ms = 0);
  // For how long its robot could have come back and has not: since it is suspended, or since the server was started.
  [[nodiscard]] Clock::duration AwayFor(Clock::time_point now) const;
  // Whether its robot has had an hour to come back since the server was started. Clocks may be wrong.
  [[nodiscard]] bool HasHadTime(Clock::time_point now) const;
  // Since when the robot is away or the session has ended, in milliseconds since 1970; 0: neither.
  [[nodiscard]] static std::uint64_t MillisecondsNow();
  [[nodiscard]] std::uint64_t quiet_since_ms() const;
  [[nodiscard]] std::vector<std::string> sensors() const;

  void SetLandmarks(std::vector<LandmarkReport> landmarks);
  void SetHypotheses(std::vector<PoseHypothesis> hypotheses);
  void SetLearned(std::vector<LearnedValue> learned);
  // Whether the robot is not joined with the map of its site, and how far it has driven since it began, or since it was
  // taken out of the map.
  struct Joining {
    bool fragment = false;
    double driven_m = 0.0;
    std::string why = {};  // Why it is not joined, where more is to be said; the status of an active session says it.
    bool joinable = true;  // Its estimator can continue in the map of the site once a job has found its place there.
  };
  void SetJoining(const Joining& joining);
  // Whether the robot is only localised, and maps nothing.
  void SetLocalises(bool localises);
  [[nodiscard]] bool localises() const;
  [[nodiscard]] Joining joining() const;
  // Another epoch of the map: the newest pose belongs to it from now on.
  void SetEpoch(std::uint32_t epoch);
  // The map around the last pose has moved (`map` before and after): the pose in the status follows.
  void MoveLast(const Pose2& T_new_old);
  // The map around the whole path has moved: the path follows (PoseHistory::MoveOnto).
  void MovePath(std::span<const StampedPose> now, bool moves_rest, std::optional<bool> fragment);
  // Frees what the path takes. From then on the snapshot's path is empty.
  void ForgetPath();
  // The last pose is not one in the present map.
  void LoseLast();
  void SetMapFrame(std::uint64_t map_frame);
  void SetAlive(bool alive);
  [[nodiscard]] bool begun() const;  // A scan was used.
  // Both return false and change nothing if the session has ended. It may have ended after the caller last looked.
  bool SetPhase(SessionPhase phase, Status status);
  // Notices that nothing arrives of a stream although the robot's client is alive, and that it arrives again. Says
  // whether this is news; state() and snapshot() show it as `stale`.
  bool LookForSilence(Clock::time_point now);
  // The robot is connected again, perhaps by another client process. Its session continues this one.
  bool Resume(ClientId client, SessionToken session);

  [[nodiscard]] ClientId owner() const;
  [[nodiscard]] SessionToken token() const;  // The owner's; samples of other sessions are dropped.
  [[nodiscard]] bool alive() const;
  [[nodiscard]] SessionPhase phase() const;
  [[nodiscard]] SessionState state() const;
  // How long the session has been suspended at `now`; zero if it is not suspended.
  [[nodiscard]] Clock::duration SuspendedFor(Clock::time_point now) const;
  // How long ago the session ended, or was restored after its end; zero if it has not ended.
  [[nodiscard]] Clock::duration EndedFor(Clock::time_point now) const;
  [[nodiscard]] std::uint32_t epoch() const;
  [[nodiscard]] SessionSnapshot snapshot() const;

  enum class Urgency { kWhenDue, kDrained, kNow };
  [[nodiscard]] std::vector<Ledger> TakeDueLedgers(Clock::time_point now, Urgency urgency);
  // A ledger that was taken could not be sent. It is due again.
  void MarkUnsent(NameId sensor_id);

 private:
  struct Stream {
    StreamLedger account{Ledger{}};
    bool changed = true;
    std::uint64_t settled_when_taken = 0;
    Clock::time_point taken{};
    Clock::time_point arrived{};  // The last sample, whatever became of it.
    bool resuming = false;        // Set after a restart, until the number after the last one arrives.
    Clock::time_point aside{};    // When the first sample was rejected as kAside.
  };
  // Both callers hold the lock of `self`. The thread-safety analysis cannot see that.
  template <typename Archive>
  static void Members(Archive& archive, auto& self, auto& odometry) CAIRN_NO_THREAD_SAFETY_ANALYSIS;
  template <typename Archive>
  static void EndMembers(Archive& archive, auto& state);
  bool LeftAside(Stream& stream, std::uint64_t sequence) const;
  // Takes a sample's number into the account. Returns kAside or kDuplicate if it must not be used.
  Arrival Account(Stream& stream, std::uint64_t sequence, std::uint64_t number, From from) CAIRN_REQUIRES(mutex_);
  Ledger NamesOf(NameId sensor_id, const std::string& sensor) const CAIRN_REQUIRES(mutex_);
  static bool IsDue(const Stream& stream, Clock::time_point now, Urgency urgency, Clock::duration period);
  Ledger TakeLedger(Stream& stream, Clock::time_point now) const CAIRN_REQUIRES(mutex_);
  SessionState StateNow() const CAIRN_REQUIRES(mutex_);
  Ledger LedgerOf(const Stream& stream) const CAIRN_REQUIRES(mutex_);
  Stream* Find(NameId sensor_id) CAIRN_REQUIRES(mutex_);
  // The number under which the present owner's account knows the sample: 0 if it is not one of the owner's.
  std::uint64_t NumberOf(SessionToken session, std::uint64_t sequence) const CAIRN_REQUIRES(mutex_);

  const SessionId id_;
  const Clock::duration ledger_period_;
  const Clock::duration gap_wait_;

  mutable Mutex mutex_;
  bool storing_ CAIRN_GUARDED_BY(mutex_) = false;           // Samples are, or soon will be, stored.
  std::uint64_t stores_from_ CAIRN_GUARDED_BY(mutex_) = 0;  // The position of the last BeginStoring.
  Status not_stored_ CAIRN_GUARDED_BY(mutex_);              // Why samples were not stored, if they were not.
  RobotStatus status_ CAIRN_GUARDED_BY(mutex_);             // Its `ledgers` stay empty: they are made on demand.
  std::string silence_ CAIRN_GUARDED_BY(mutex_);            // What is stale; empty: nothing.
  Clock::time_point active_ CAIRN_GUARDED_BY(mutex_);       // Start of the activity, if active.
  Clock::time_point suspended_ CAIRN_GUARDED_BY(mutex_);    // Start of the suspension, if suspended.
  Clock::time_point ended_ CAIRN_GUARDED_BY(mutex_);        // If it has ended.
  std::uint64_t quiet_since_ms_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::optional<Clock::time_point> restored_ CAIRN_GUARDED_BY(mutex_);
  std::map<NameId, Stream> streams_ CAIRN_GUARDED_BY(mutex_);
  Stream odometry_ CAIRN_GUARDED_BY(mutex_);
  PoseHistory history_ CAIRN_GUARDED_BY(mutex_);
  Joining joining_ CAIRN_GUARDED_BY(mutex_);
  bool localises_ CAIRN_GUARDED_BY(mutex_) = false;
  std::shared_ptr<const std::vector<LandmarkReport>> landmarks_ CAIRN_GUARDED_BY(mutex_);
  std::vector<PoseHypothesis> hypotheses_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::server
