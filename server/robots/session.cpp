#include "server/robots/session.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <asio/post.hpp>
#include <exception>
#include <utility>
#include <variant>

#include "common/thread_time.h"
#include "server/ops/log_context.h"
#include "server/store/crash_note.h"

namespace cairn::server {
namespace {

// A robot waits this long for the disk when it opens a session or ends it.
constexpr std::chrono::seconds kDiskPatience{1};

}  // namespace

Session::Session(const SessionSetup& setup, const RobotsOptions& options, asio::thread_pool& pool,
                 SessionOutputs outputs)
    : id_(setup.id),
      stored_{setup.id,
              setup.request,
              setup.map_epoch,
              setup.estimator.fragment,
              setup.quiet_since_ms,
              setup.estimator.map_begun},
      outputs_(std::move(outputs)),
      record_(setup.id, setup.request, options),
      merge_(std::chrono::round<ScanMerge::Clock::duration>(
                 std::chrono::duration<double>(setup.estimator.mapper.pairing.no_odometry_after_s)),
             static_cast<std::size_t>(options.queue_scans)),
      queue_(static_cast<std::size_t>(options.queue_scans), static_cast<std::size_t>(options.queue_odometry)),
      strand_(asio::make_strand(pool)),
      pace_(outputs_.checkpoint_limits),
      estimator_(
          [&] {
            record_.SetEpoch(setup.map_epoch);
            return setup.estimator;
          }(),
          record_, outputs_) {}

Session::~Session() {
  if (!outputs_.gone || keep_stored_) return;
  try {
    outputs_.gone();
  } catch (const std::exception& error) {  // Such as without memory. What is stored of it is read at the next start.
    spdlog::error("session {} is not taken out of its site: {}", id_, error.what());
  }
}

// A sample that is settled here, away from the strand, is recorded before it is journalled. A checkpoint that is taken
// in between already contains it, so its journal entry is ignored when it is read.
bool Session::Take(ScanArrival&& arrival) {
  const NameId sensor = arrival.stream.sensor_id;
  const std::uint64_t sequence = arrival.scan->sequence;
  if (arrival.stream.session != record_.token()) {
    const bool known = record_.ForeignScan(sensor, DropReason::kNotOwner) != SessionRecord::Arrival::kUnknownSensor;
    PublishLedgers(SessionRecord::Urgency::kWhenDue);
    return known;
  }
  const SessionRecord::Arrival kind = record_.ScanReceived(arrival.stream, sequence);
  if (kind != SessionRecord::Arrival::kNew) return kind != SessionRecord::Arrival::kUnknownSensor;
  if (ending_ || arrival.refused) {
    const DropReason reason = arrival.refused.value_or(DropReason::kSessionEnded);
    record_.ScanDropped(arrival.stream, sequence, reason);
    Store(ScanRefused{arrival.stream, sequence, reason});
    PublishLedgers(SessionRecord::Urgency::kWhenDue);
    return true;
  }
  const MutexLock lock(merge_mutex_);
  Enqueue(merge_.Add(std::move(arrival), ScanMerge::Clock::now()));
  return true;
}

void Session::Enqueue(std::vector<ScanArrival>&& scans) {
  if (scans.empty()) return;
  for (ScanArrival& scan : scans) {
    const auto displaced = queue_.Push(std::move(scan));
    if (!displaced) continue;
    record_.ScanDropped(displaced->stream, displaced->scan->sequence, DropReason::kQueueFull);
    Store(ScanRefused{displaced->stream, displaced->scan->sequence, DropReason::kQueueFull});
  }
  Schedule();
}

// Before an event that is to come after all scans that have arrived.
void Session::EnqueueAll() {
  const MutexLock lock(merge_mutex_);
  Enqueue(merge_.TakeAll());
}

void Session::EnqueueDue() {
  const MutexLock lock(merge_mutex_);
  Enqueue(merge_.TakeDue(ScanMerge::Clock::now()));
}

void Session::WaitNoMoreForOdometry() {
  {
    const MutexLock lock(merge_mutex_);
    merge_.OdometryCame();
  }
  EnqueueDue();
}

void Session::Take(OdometryArrival&& arrival) {
  const std::uint64_t sequence = arrival.odometry.sequence;
  if (arrival.stream.session != record_.token() || !record_.OdometryReceived(arrival.stream.session, sequence)) return;
  if (arrival.refused || ending_) {
    record_.OdometryDropped(arrival.stream.session, sequence,
                            arrival.refused ? DropReason::kBadGeometry : DropReason::kSessionEnded);
    Store(OdometryTaken{arrival.stream, arrival.odometry, OdometryUse::kRefused});
    return;
  }
  if (const auto merged = queue_.Push(std::move(arrival))) {
    record_.OdometryDropped(merged->stream.session, merged->odometry.sequence, DropReason::kQueueFull);
    Store(OdometryTaken{merged->stream, merged->odometry, OdometryUse::kMerged});
  }
  WaitNoMoreForOdometry();
  Schedule();
}

void Session::Adopt(Correction&& correction) {
  queue_.Push(std::move(correction));
  Schedule();
}

void Session::SetMapEpoch(std::uint32_t epoch) {
  queue_.Push(EpochChange{epoch});
  Schedule();
}

bool Session::Post(SnapshotWanted&& wanted) {
  if (!queue_.Push(std::move(wanted))) return false;
  Schedule();
  return true;
}

void Session::RefuseStart(const std::string& why) {
  queue_.Push(StartRefused{why});
  Schedule();
}

std::optional<StoredSession> Session::TakeChangedStored() {
  const std::uint64_t quiet_since_ms = record_.quiet_since_ms();
  if (std::exchange(stored_.quiet_since_ms, quiet_since_ms) == quiet_since_ms) return std::nullopt;
  return stored_;
}

void Session::SetLiveliness(bool alive) {
  record_.SetAlive(alive);
  const SessionPhase wanted = alive ? SessionPhase::kActive : SessionPhase::kSuspended;
  if (ending_ || record_.phase() == wanted) return;
  Status status = alive ? Status{} : Status{StatusCode::kUnavailable, "the robot's client has left; it may come back"};
  if (record_.SetPhase(wanted, std::move(status))) AnnounceState();
}

bool Session::Resume(ClientId client, SessionToken session) {
  if (!record_.Resume(client, session)) return false;
  Store(OwnerChanged{client, session, record_.sensors()});
  AnnounceState();
  return true;
}

void Session::Suspend(const std::function<void()>& done) {
  // If the end was requested before, it is handled first, and there is nothing left to suspend.
  const bool ended_before = ending_.exchange(true);
  Finish finish;
  finish.final = false;
  finish.done = [self = shared_from_this(), done, ended_before] {
    if (!ended_before) {
      self->Finished(SessionPhase::kSuspended, {StatusCode::kUnavailable, "the server is stopping"});
    }
    done();
  };
  EnqueueAll();
  queue_.Push(std::move(finish));
  Schedule();
}

void Session::Abandon() {
  EnqueueAll();
  for (const ScanArrival& scan : queue_.TakeScans()) {
    record_.ScanDropped(scan.stream, scan.scan->sequence, DropReason::kSessionEnded);
  }
  // The session may have published its last ledger while these scans, already out of the queue, still counted as
  // waiting.
  PublishLedgers(SessionRecord::Urgency::kNow);
}

void Session::Store(JournalEntry entry) {
  if (outputs_.store) static_cast<void>(outputs_.store(std::move(entry)));
}

void Session::Lost(const Status& why) {
  lost_ = true;
  const bool untold = end_untold_.exchange(false);
  if (record_.SetStored(false, why) || untold) AnnounceState();
}

void Session::Durable(const std::vector<JournalEntry>& entries) {
  record_.Durable(entries);
  const bool begins = unannounced_.exchange(false);
  bool ends = false;
  if (std::ranges::any_of(entries, [](const auto& one) { return std::holds_alternative<SessionFinished>(one); })) {
    end_stored_ = true;
    ends = end_untold_.exchange(false);
  }
  if (begins || ends) AnnounceState();
  PublishLedgers(SessionRecord::Urgency::kWhenDue);
}

void Session::ExpectDurable() {
  static_cast<void>(record_.SetStored(true));
  unannounced_ = true;
  opened_ = SessionRecord::Clock::now();
}

void Session::Replay(JournalEntry&& entry, const SessionEstimator::Switched& switched) {
  const auto begin = ThreadTime();
  if (!failed_) Throws([&] { estimator_.Replay(std::move(entry), switched); });
  pace_.Worked(ThreadTime() - begin);
}

void Session::Replayed() {
  Throws([this] { estimator_.Replayed(); });  // Also of one that failed: what it has drawn is part of the map.
  record_.Restored(stored_.quiet_since_ms);
  if (record_.begun()) WaitNoMoreForOdometry();  // Its first scans were used.
  if (record_.phase() == SessionPhase::kEnded) ending_ = true;
  state_unsent_ = true;
}

void Session::Tick() {
  // If the disk is slow, the robot need not wait for it: a scan counts as durable only once it is on the disk.
  const auto now = SessionRecord::Clock::now();
  if (unannounced_ && now - opened_ > kDiskPatience) {
    unannounced_ = false;
    AnnounceState();
  }
  TickEnded(now);
  EnqueueDue();
  // The disk may work again, while nothing arrives from the robot. Or memory was short when an event came.
  if ((lost_ && !ending_) || !queue_.empty()) Schedule();
  if (record_.LookForSilence(now)) state_unsent_ = true;
  if (state_unsent_) AnnounceState();
  PublishLedgers(SessionRecord::Urgency::kWhenDue);
}

void Session::TickEnded(SessionRecord::Clock::time_point now) {
  if (end_untold_ && record_.EndedFor(now) > kDiskPatience) {
    end_untold_ = false;
    AnnounceState();
  }
  if (record_.phase() == SessionPhase::kEnded && (end_unsaved_ || lost_)) Schedule();
}

void Session::Finished(SessionPhase phase, Status status) {
  // Told when it is on the disk (Durable): whoever has seen the end may rely on it, also after a kill.
  end_untold_ = phase == SessionPhase::kEnded && outputs_.position && outputs_.position() != 0;
  if (end_stored_) end_untold_ = false;
  record_.SetPhase(phase, std::move(status));
  if (phase == SessionPhase::kEnded && outputs_.ended) outputs_.ended();
  PublishLedgers(SessionRecord::Urgency::kNow);
  AnnounceState();
}

void Session::AnnounceState() {
  if (unannounced_ || end_untold_) return;
  const MutexLock lock(publishing_);
  state_unsent_ = !outputs_.send(record_.state());
}

void Session::PublishLedgers(SessionRecord::Urgency urgency) {
  const MutexLock lock(publishing_);
  for (Ledger& ledger : record_.TakeDueLedgers(SessionRecord::Clock::now(), urgency)) {
    const NameId sensor_id = ledger.sensor_id;
    if (!outputs_.send(std::move(ledger))) record_.MarkUnsent(sensor_id);
  }
}

void Session::Schedule() {
  if (scheduled_.exchange(true)) return;
  scheduled_at_ = SessionRecord::Clock::now();
  try {
    asio::post(strand_, [self = shared_from_this()] { self->Drain(); });
  } catch (const std::exception& error) {  // The next event tries it again, or housekeeping.
    scheduled_ = false;
    spdlog::error("session {} waits for its turn: {}", id_, error.what());
  }
}

void Session::Drain() {
  const CrashNote::Working working(id_);
  if (outputs_.waited) outputs_.waited(SessionRecord::Clock::now() - scheduled_at_.load());
  const auto begin = ThreadTime();
  for (int i = 0; i < kEventsPerTurn; ++i) {
    std::optional<RobotEvent> event = queue_.Pop();
    if (!event) break;
    handling_ = true;
    Handle(std::move(*event));
    ++handled_;
    handling_ = false;
  }
  bool draws_on = false;
  if (!failed_) Throws([&] { draws_on = estimator_.DrawLate(); });
  pace_.Worked(ThreadTime() - begin);
  const bool drained = queue_.empty();
  Throws([this] { TakeCheckpoint(); });
  ++handled_;  // The turn itself: it may have had no events.
  Throws([&] { PublishLedgers(drained ? SessionRecord::Urgency::kDrained : SessionRecord::Urgency::kWhenDue); });
  scheduled_ = false;
  // An event that came between the last Pop and the line above found `scheduled_` set and relies on this turn.
  if (!queue_.empty() || (draws_on && !failed_)) Schedule();
}

void Session::Handle(RobotEvent&& event) {
  // What its status says of the robot's place may change with these.
  const bool changes_state = std::holds_alternative<StartRefused>(event) || std::holds_alternative<Correction>(event) ||
                             std::holds_alternative<LocaliseWanted>(event);
  const bool changes_ended = std::holds_alternative<Finish>(event) || std::holds_alternative<Correction>(event);
  if (!failed_ && !Throws([&] { estimator_.Handle(std::move(event)); })) {
    if (changes_state) state_unsent_ = true;
    if (changes_ended && outputs_.checkpoint && record_.phase() == SessionPhase::kEnded) end_unsaved_ = true;
    return;
  }
  Throws([&] { estimator_.Discard(std::move(event)); });
}

template <typename Act>
bool Session::Throws(Act act) noexcept {
  try {
    act();
    return false;
  } catch (const std::exception& error) {
    Fail(error.what());
  } catch (...) {
    Fail("an exception without a name");
  }
  return true;
}

void Session::Fail(const char* what) noexcept {
  const bool first = !std::exchange(failed_, true);
  ending_ = true;
  try {
    if (!first) return;
    const std::string robot = record_.state().robot;
    const LogContext context(AboutRobot(robot, record_.state().site));
    spdlog::error("robot '{}': its session ends because of an exception: {}", robot, what);
    const Status why{StatusCode::kInternal, "the estimator of '" + robot + "' failed: " + what};
    // The next server may not fail where this one did, but the robot knows that the session has ended.
    if (!estimator_.replaying()) Store(SessionFinished{true, why});
    estimator_.DropWaiting();
    state_unsent_ = true;  // Should the next line fail as well, housekeeping tries again.
    Finished(SessionPhase::kEnded, why);
  } catch (...) {
    // Whatever it was, the first exception is the one to know about; housekeeping announces the end later.
  }
}

}  // namespace cairn::server
