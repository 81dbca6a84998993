// One run of a robot in a site: its owner, its queue, its strand and its estimator. Survives disconnection; ends on
// request. What arrives is admitted or refused at once (owner, phase, duplicate), queued, and handled on the strand in
// order of arrival; sessions run in parallel on one thread pool. An exception in the estimator, or in what it calls,
// ends this session with the reason in its state and in the log; all others go on. Thread rule: any thread may call;
// nothing here waits for the estimator.
#pragma once

#include <asio/strand.hpp>
#include <asio/thread_pool.hpp>
#include <atomic>
#include <memory>
#include <vector>

#include "common/mutex.h"
#include "server/ops/heartbeat.h"
#include "server/robots/robot_queue.h"
#include "server/robots/scan_merge.h"
#include "server/robots/session_estimator.h"
#include "server/robots/session_record.h"

namespace cairn::server {

struct SessionSetup {
  SessionId id = 0;
  SessionRequest request;
  std::uint32_t map_epoch = 0;
  EstimatorSetup estimator;
  std::uint64_t quiet_since_ms = 0;  // SessionRecord::Restored.
};

class Session : public GridOwner, public std::enable_shared_from_this<Session> {
 public:
  Session(const SessionSetup& setup, const RobotsOptions& options, asio::thread_pool& pool, SessionOutputs outputs);

  ~Session() override;

  // False if the stream is not this session's: an undeclared sensor.
  bool Take(ScanArrival&& arrival);
  void Take(OdometryArrival&& arrival);
  // The newest correction wins; one still waiting is dropped without a call to its `done`.
  void Adopt(Correction&& correction) override;
  void SetMapEpoch(std::uint32_t epoch) override;
  // Asks for a snapshot; false where too many wait.
  bool Post(SnapshotWanted&& wanted);
  // Tells where a job has found the robot; false where too many events wait, and then its `done` is not called.
  bool Post(PlaceFound&& found);
  // From now on it is a fragment: it is not where somebody said it starts.
  void RefuseStart(const std::string& why);
  // The robot has to be found in its map. FAILED_PRECONDITION: the session is ending, or a pose is given and the robot
  // is not joined with the map. RESOURCE_EXHAUSTED: too many events wait. `receipt` tells when the estimator has it;
  // null if nobody is to be told.
  [[nodiscard]] Result<void> Relocalise(const std::optional<Pose2>& T_map_robot,
                                        std::shared_ptr<Receipt> receipt = nullptr);

  // From now on the robot is only localised in this map, near where it is in the map or, if that is not known,
  // everywhere (slam::Mapper::LocaliseIn); MapAgain ends that. FAILED_PRECONDITION: the session is ending, the map
  // is too wide, or a robot that is to map again is not joined with the map. RESOURCE_EXHAUSTED: too many events wait.
  [[nodiscard]] Result<void> Localise(std::shared_ptr<const MapSnapshot> map,
                                      std::shared_ptr<Receipt> receipt = nullptr);
  [[nodiscard]] Result<void> MapAgain(std::shared_ptr<Receipt> receipt = nullptr);
  // Gives a robot that is only localised the map again: at once where its epoch is another one, and where others have
  // drawn, after some minutes.
  void KeepUpWith(const std::shared_ptr<const MapSnapshot>& map);

  // What the store is to hold of the session itself, where that has changed since the last call. Thread rule: one
  // thread.
  [[nodiscard]] std::optional<StoredSession> TakeChangedStored();

  // The owner's liveliness lease was lost or came back: kSuspended or kActive.
  void SetLiveliness(bool alive);
  // Returns false if the session has ended meanwhile.
  bool Resume(ClientId client, SessionToken session);
  // The session finishes the scans that have arrived and then ends for good. Its state contains `reason`.
  void End(const Status& reason = {}, std::shared_ptr<Receipt> receipt = nullptr);
  // Like End, but the session is only suspended, because the server stops. `done` is always called, on the strand.
  void Suspend(const std::function<void()>& done);
  // Drops the scans still waiting; what is being estimated is finished.
  void Abandon();
  // Publishes the state once more.
  void Announce() { AnnounceState(); }
  // Called for the journal. ExpectDurable: the session's record is being written; the session is announced as open when
  // Durable is called for the first time. Lost: from now on nothing of the session is stored, until the disk works
  // again and a checkpoint of its present state is on it.
  void ExpectDurable();
  void Durable(const std::vector<JournalEntry>& entries);
  void Lost(const Status& why);
  // See SessionEstimator. Called from one thread, before any other thread knows the session.
  void Replay(JournalEntry&& entry, const SessionEstimator::Switched& switched);
  void Replayed();
  // Whether its records stay in the store when it is destroyed, because it is a restored one that is not used after
  // all.
  void KeepStored(bool keep = true) { keep_stored_ = keep; }
  [[nodiscard]] Result<SessionEstimator::PieceValues> Load(std::string_view main,
                                                           std::span<const std::string_view> pieces) {
    return estimator_.Load(main, pieces);
  }
  // Its newest checkpoint, and the last entry of its journal. REQUIRES: nothing was taken yet.
  void SetCheckpointed(std::uint64_t position, std::uint64_t last);
  // What is still to be done for one that has ended: its end is announced also where the disk is slow, and it takes the
  // checkpoint that could not be taken yet. It takes one after its end and after each switch of the map, or its journal
  // would grow with every switch.
  void TickEnded(SessionRecord::Clock::time_point now);
  // Publishes ledgers that are due and whatever could not be sent before.
  void Tick();

  [[nodiscard]] SessionRecord& record() { return record_; }
  [[nodiscard]] const SessionRecord& record() const { return record_; }
  [[nodiscard]] SessionId id() const { return id_; }
  // Whether the end was requested; the session may still have scans to finish.
  [[nodiscard]] bool ending() const { return ending_; }
  // Busy while an event is being handled; while it waits for a thread of the pool it does not count as busy.
  [[nodiscard]] Pulse pulse() const { return {handled_, handling_}; }
  // Events wait or are being handled.
  [[nodiscard]] bool has_work() const { return scheduled_; }
  // It has ended, which is not announced yet.
  [[nodiscard]] bool end_untold() const { return end_untold_; }

  static constexpr int kEventsPerTurn = 8;  // After so many, the pool may do other work first.

 private:
  void Enqueue(std::vector<ScanArrival>&& scans) CAIRN_REQUIRES(merge_mutex_);
  void EnqueueAll() CAIRN_EXCLUDES(merge_mutex_);
  void EnqueueDue() CAIRN_EXCLUDES(merge_mutex_);
  void WaitNoMoreForOdometry() CAIRN_EXCLUDES(merge_mutex_);
  void Schedule();
  void Drain();
  void Handle(RobotEvent&& event);
  void TakeCheckpoint();
  void StoreAgain();
  bool SaveAt(std::uint64_t position, Journal::Done done);
  // Calls `act`; whether it threw. The session has then failed.
  template <typename Act>
  bool Throws(Act act) noexcept;
  void Fail(const char* what) noexcept;
  void Store(JournalEntry entry);
  void AnnounceState();
  void PublishLedgers(SessionRecord::Urgency urgency);
  void Finished(SessionPhase phase, Status status);
  // An end was asked for, or the server stops, and that is not settled yet. What is dropped then is in the record but
  // not in the journal. The client sends it again to the next server, which must not take it for something that it has
  // received before; so there are no checkpoints.
  [[nodiscard]] bool stopping() const { return ending_ && record_.phase() != SessionPhase::kEnded; }

  const SessionId id_;
  StoredSession stored_;
  const SessionOutputs outputs_;
  SessionRecord record_;
  Mutex merge_mutex_;
  ScanMerge merge_ CAIRN_GUARDED_BY(merge_mutex_);
  RobotQueue queue_;
  std::atomic<bool> ending_{false};  // An end was asked for: nothing new is taken.
  std::atomic<bool> state_unsent_{false};
  std::atomic<bool> lost_{false};  // Nothing of it is stored any more, until StoreAgain.
  std::atomic<bool> keep_stored_{false};
  std::atomic<bool> unannounced_{false};  // Not announced as open until its record is on the disk.
  SessionRecord::Clock::time_point opened_{};
  std::atomic<bool> end_untold_{false};   // It has ended, which is announced when that is on the disk.
  std::atomic<bool> end_stored_{false};   // That is on the disk.
  std::atomic<bool> end_unsaved_{false};  // Ended, and no checkpoint has what it is now.
  std::atomic<bool> scheduled_{false};
  std::atomic<SessionRecord::Clock::time_point> scheduled_at_{};
  std::atomic<bool> handling_{false};
  std::atomic<std::uint64_t> handled_{0};
  // What the map was when it was given to the estimator of a robot that is only localised.
  struct KnownMap {
    std::uint32_t epoch = 0;
    std::uint64_t version = 0;
    std::uint64_t edits_version = 0;
    SessionRecord::Clock::time_point given{};
  };
  Mutex known_map_mutex_;
  std::optional<KnownMap> known_map_ CAIRN_GUARDED_BY(known_map_mutex_);
  // Held from the reading of a state to its sending: an older state must not overtake a newer one on its way out.
  Mutex publishing_;
  asio::strand<asio::thread_pool::executor_type> strand_;
  // Strand only.
  CheckpointPace pace_;
  bool failed_ = false;  // An exception has left the estimator in an unknown state: it is not asked any more.
  SessionEstimator estimator_;
};

}  // namespace cairn::server
