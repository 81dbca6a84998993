// The journal's thread: takes what waits, and commits it (journal.h).
#include <algorithm>
#include <exception>
#include <iterator>
#include <utility>

#include "server/store/journal.h"
#include "server/store/site_contents.h"

namespace cairn::server {
namespace {

constexpr auto kRetry = std::chrono::seconds(1);
constexpr auto kBudgetPeriod = std::chrono::seconds(10);
constexpr int kPiecesAtStop = 20;

}  // namespace

void Journal::Run(const std::stop_token& stop) {
  while (auto group = Next(stop)) {
    try {
      if (!RunOnce(std::move(*group), stop)) return;
    } catch (const std::exception& error) {  // For example, not enough memory for the group.
      StartOver(std::string("the journal lost changes by an exception: ") + error.what());
    }
  }
  // The rest is for the next start.
  for (int pieces = 0; pieces < kPiecesAtStop && !unwanted_.empty() && Clock::now() >= next_piece_; ++pieces)
    RemovePiece();
}

// Returns false if the group could not be written before the stop: what comes after it must not be on the disk.
bool Journal::RunOnce(Group&& group, const std::stop_token& stop) {
  const Clock::time_point oldest = group.oldest;
  const std::vector<Work> works = std::move(group.works);
  std::ranges::move(group.told, std::back_inserter(telling_));
  std::optional<WantedCheckpoint> wanted = std::move(group.checkpoint);
  Prepared prepared = Prepare(std::move(group));
  LeaveOutTooLong(prepared);
  DropForgottenCheckpoint();
  if (!stop.stop_requested()) WriteCheckpoint(std::move(wanted), prepared.changes);
  if (!prepared.empty() && !CommitPatiently(prepared.changes, stop)) return false;
  Tell(prepared, oldest);
  for (const std::uint64_t session : prepared.forgotten)
    std::ranges::move(RangesOfRemoved(session), std::back_inserter(unwanted_));
  if (writing_ && writing_->complete()) {
    EndCheckpoint();
    if (const auto written = std::exchange(written_, nullptr)) written(true);
    budget_checked_ = {};  // The journal before it may be removed now.
  }
  TellOrders();
  for (const Work& work : works) work(store_);
  // At first, and after works, which may have deleted sessions.
  if (!std::exchange(rests_known_, true) || !works.empty()) FindRests();
  RemovePiece();
  KeepBudget();
  return true;
}

// After an exception, from which nothing tells what of a group is on the disk: no session is stored from here on, until
// it is stored again with a checkpoint (Recover).
void Journal::StartOver(const std::string& why) {
  const Done written = std::exchange(written_, nullptr);
  writing_.reset();
  {
    const MutexLock lock(mutex_);
    committing_bytes_ = 0;
    left_out_ = why;
    for (auto& [session, line] : lines_) {
      line.checkpointing = false;
      Lose(session, line, why);
    }
    std::erase_if(queue_, [](const Change& change) { return std::holds_alternative<Appended>(change); });
  }
  if (written) written(false);
  TellOrders();
}

class Journal::Asking {
 public:
  explicit Asking(Journal& journal) : journal_(journal) { Set(Clock::now()); }
  Asking(const Asking&) = delete;
  Asking& operator=(const Asking&) = delete;
  ~Asking() { Set(std::nullopt); }

 private:
  void Set(std::optional<Clock::time_point> since) {
    const MutexLock lock(journal_.mutex_);
    journal_.asking_since_ = since;
  }

  Journal& journal_;
};

void Journal::FindRests() {
  const auto removed = store_.Owners(RecordKind::kRemoved);
  if (!removed) return;  // The disk fails; the next start finds them.
  for (const std::uint64_t session : *removed)
    std::ranges::move(RangesOfRemoved(session), std::back_inserter(unwanted_));
}

void Journal::TellOrders() {
  for (const auto& tell : std::exchange(telling_, {})) tell();
}

// A new session may have the number of one that is gone only after nothing is left of it, but an open one is safe here
// in any case.
void Journal::RemovePiece() {
  if (unwanted_.empty() || Clock::now() < next_piece_) return;
  const RecordRange& range = unwanted_.front();
  {
    const MutexLock lock(mutex_);
    const auto line = lines_.find(range.owner);
    if (line != lines_.end() && range.last > line->second.checkpointed) {
      unwanted_.pop_front();
      return;
    }
  }
  const Asking asking(*this);
  const std::size_t piece = RemovedAtOnce(range.kind);
  const auto removed = store_.RemoveFirst(range, piece);
  if (removed) {
    if (*removed < piece) unwanted_.pop_front();
    return;
  }
  next_piece_ = Clock::now() + kRetry;
  // What cannot be removed for another reason than a full disk must not stop the others. The next start tries it again.
  if (removed.error().code != StatusCode::kResourceExhausted) unwanted_.pop_front();
}

std::optional<Journal::Group> Journal::Next(const std::stop_token& stop) {
  const auto delay = std::chrono::milliseconds(options_.commit_delay_ms);
  const MutexLock lock(mutex_);
  while (queue_.empty() && checkpoints_.empty() && works_.empty() && told_.empty() && !writing_ &&
         !stop.stop_requested()) {
    if (unwanted_.empty()) {
      arrived_.Wait(mutex_);
    } else if (Clock::now() < next_piece_) {
      arrived_.WaitUntil(mutex_, next_piece_);
    } else {
      break;
    }
  }
  if (queue_.empty() && stop.stop_requested()) return std::nullopt;
  const auto due = oldest_ + delay;
  while (!queue_.empty() && !urgent_ && !writing_ && !stop.stop_requested() && Clock::now() < due)
    arrived_.WaitUntil(mutex_, due);
  urgent_ = false;
  committing_bytes_ = std::exchange(queued_bytes_, 0);
  queued_records_.clear();
  Group group{std::exchange(queue_, {}), std::exchange(works_, {}), std::exchange(told_, {}), std::nullopt, oldest_};
  // Together with the queue: the entries before a checkpoint are in this group or in an earlier one.
  if (!writing_) group.checkpoint = TakeCheckpoint();
  return group;
}

// That of the session with the longest journal after its last one. A server that is killed again and again may have
// time for one only between two kills, and would otherwise repeat the journals of the other sessions at each start.
std::optional<Journal::WantedCheckpoint> Journal::TakeCheckpoint() {
  const auto journal_length = [this](const WantedCheckpoint& wanted) CAIRN_NO_THREAD_SAFETY_ANALYSIS {
    const auto line = lines_.find(wanted.session);
    return line == lines_.end() ? 0 : line->second.next - 1 - line->second.checkpointed;
  };
  const auto longest = std::ranges::max_element(checkpoints_, {}, journal_length);
  if (longest == checkpoints_.end()) return std::nullopt;
  WantedCheckpoint taken = std::move(*longest);
  checkpoints_.erase(longest);
  return taken;
}

Journal::Prepared Journal::Prepare(Group&& group) {
  Prepared prepared;
  std::map<RecordKey, std::string> put;
  auto& batches = prepared.batches;
  for (Change& change : group.changes) {
    if (auto* const appended = std::get_if<Appended>(&change)) {
      Batch& batch = batches[appended->session];
      if (batch.entries.empty()) batch.first = appended->position;
      batch.entries.push_back(std::move(appended->entry));
    } else if (const auto* const written = std::get_if<Written>(&change)) {
      put[written->key] = written->bytes();
      if (written->key.kind == RecordKind::kSession) batches.try_emplace(written->key.owner);
    } else if (const auto* const range = std::get_if<RecordRange>(&change)) {
      std::erase_if(put, [range](const auto& one) { return range->Covers(one.first); });
      if (range->kind == RecordKind::kJournal) batches.erase(range->owner);
      prepared.changes.removed.push_back(*range);
    } else if (const auto* const forgotten = std::get_if<Forgotten>(&change)) {
      const std::uint64_t session = forgotten->session;
      put.erase({RecordKind::kSession, session, 0});
      batches.erase(session);
      prepared.forgotten.push_back(session);
      std::erase_if(put, [session](const auto& one) {
        return one.first.kind == RecordKind::kRelations && one.first.owner == session;
      });
      for (const RecordKind kind : {RecordKind::kSession, RecordKind::kRestoring, RecordKind::kRelations})
        prepared.changes.removed.push_back({.kind = kind, .owner = session});
      put[MarkOfRemoved(session).key] = MarkOfRemoved(session).bytes;
    }
  }
  for (const auto& [session, batch] : batches) {
    if (batch.entries.empty()) continue;
    put[{RecordKind::kJournal, session, batch.first + batch.entries.size() - 1}] = BytesOf(batch.first, batch.entries);
  }
  for (auto& [key, bytes] : put) prepared.changes.put.push_back({key, std::move(bytes)});
  return prepared;
}

// A message over 2 GB has no bytes at all (Protobuf).
void Journal::LeaveOutTooLong(Prepared& prepared) {
  const auto too_long = [this](const Record& record) {
    return record.bytes.empty() || record.bytes.size() > store_.max_record_bytes();
  };
  const MutexLock lock(mutex_);
  std::erase_if(prepared.changes.put, [&](const Record& record) CAIRN_NO_THREAD_SAFETY_ANALYSIS {
    if (!too_long(record)) return false;
    std::string why = "a record is too long for the store and was left out, of kind " +
                      std::to_string(static_cast<int>(record.key.kind)) + " and owner " +
                      std::to_string(record.key.owner) + ", with " + std::to_string(record.bytes.size()) + " bytes";
    const bool of_session = record.key.kind == RecordKind::kJournal || record.key.kind == RecordKind::kSession;
    if (of_session) {
      prepared.batches.erase(record.key.owner);  // It is not told that these entries are on the disk.
      if (const auto line = lines_.find(record.key.owner); line != lines_.end())
        Lose(record.key.owner, line->second, std::move(why));
    } else {
      left_out_ = std::move(why);
    }
    return true;
  });
}

// The parts of a checkpoint that are written already are removed with the session.
void Journal::DropForgottenCheckpoint() {
  const MutexLock lock(mutex_);
  if (!writing_ || lines_.contains(writing_->session())) return;
  writing_.reset();
  written_ = nullptr;
}

// Adds the next records of the checkpoint that is being written, or of a new one. One that cannot be made, for example
// because memory is short, is left out: the one before it stays, and the journal goes on.
void Journal::WriteCheckpoint(std::optional<WantedCheckpoint> wanted, RecordChanges& changes) {
  if (!wanted && !writing_) return;
  const std::uint64_t session = writing_ ? writing_->session() : wanted->session;
  Done done = wanted ? wanted->done : written_;
  try {
    if (wanted) BeginCheckpoint(std::move(*wanted));
    RecordChanges records;
    if (writing_) writing_->AddTo(records);
    if (writing_ && writing_->complete()) AddRecovered(session, records);
    std::ranges::move(records.removed, std::back_inserter(changes.removed));
    std::ranges::move(records.put, std::back_inserter(changes.put));
  } catch (const std::exception& error) {
    writing_.reset();
    written_ = nullptr;
    {
      const MutexLock lock(mutex_);
      checkpoint_fault_ = std::string("the last checkpoint could not be made: ") + error.what();
      if (const auto line = lines_.find(session); line != lines_.end()) {
        line->second.checkpointing = false;
        if (line->second.recovers_at != 0) Lose(session, line->second, checkpoint_fault_);
      }
    }
    if (done) done(false);
  }
}

// What belongs to the checkpoint of Recover, in one commit with it: the session itself, if it is not there yet, because
// with neither checkpoint nor journal it would begin where its robot once stood.
void Journal::AddRecovered(std::uint64_t session, RecordChanges& changes) {
  const MutexLock lock(mutex_);
  const auto line = lines_.find(session);
  if (line == lines_.end() || line->second.recovers_at != writing_->position()) return;
  if (line->second.unwritten)
    changes.put.push_back({{RecordKind::kSession, session, 0}, BytesOf(*line->second.unwritten)});
}

void Journal::BeginCheckpoint(WantedCheckpoint wanted) {
  StoredPieces pieces;
  {
    const MutexLock lock(mutex_);
    const auto line = lines_.find(wanted.session);
    if (line == lines_.end()) return;  // It was closed meanwhile.
    pieces = line->second.pieces;
  }
  writing_.emplace(wanted.session, wanted.position, wanted.content(), std::move(pieces));
  written_ = std::move(wanted.done);
}

bool Journal::CommitOnce(const RecordChanges& changes) {
  const auto committed = [&] {
    const Asking asking(*this);
    return store_.Commit(changes);
  }();
  const MutexLock lock(mutex_);
  disk_fault_ = committed ? std::string() : committed.error().message;
  ++(committed ? counts_.commits : counts_.failed_commits);
  return committed.has_value();
}

bool Journal::CommitPatiently(const RecordChanges& changes, const std::stop_token& stop) {
  while (!CommitOnce(changes)) {
    TellOrders();   // That it fails can be seen in the status.
    RemovePiece();  // Where the disk is full, this makes room.
    const auto again = Clock::now() + kRetry;
    const MutexLock lock(mutex_);
    while (!stop.stop_requested() && Clock::now() < again) arrived_.WaitUntil(mutex_, again);
    if (stop.stop_requested()) return false;
  }
  return true;
}

void Journal::Tell(const Prepared& prepared, Clock::time_point oldest) {
  std::vector<std::pair<Durable, const Batch*>> told;
  {
    const MutexLock lock(mutex_);
    committing_bytes_ = 0;
    if (prepared.empty()) return;
    delays_.Add(Clock::now() - oldest);
    for (const auto& [session, batch] : prepared.batches) {
      counts_.entries += batch.entries.size();
      const auto line = lines_.find(session);
      if (line == lines_.end()) continue;
      line->second.unwritten.reset();
      if (line->second.durable) told.emplace_back(line->second.durable, &batch);
    }
  }
  for (const auto& [durable, batch] : told) durable(batch->entries);
}

void Journal::EndCheckpoint() {
  const MutexLock lock(mutex_);
  const auto line = lines_.find(writing_->session());
  if (line != lines_.end()) {
    line->second.checkpointing = false;
    line->second.checkpointed = writing_->position();
    line->second.pieces = writing_->pieces();
    if (line->second.recovers_at == writing_->position()) {
      line->second.unwritten.reset();
      // The journal before it has a gap.
      unwanted_.push_back({.kind = RecordKind::kJournal, .owner = writing_->session(), .last = writing_->position()});
      ReleaseHeld(writing_->session(), line->second);
    }
  }
  checkpoint_fault_.clear();
  writing_.reset();
}

void Journal::KeepBudget() {
  if (!unwanted_.empty() || Clock::now() - budget_checked_ < kBudgetPeriod) return;
  budget_checked_ = Clock::now();
  std::optional<Asking> asking(*this);
  const auto used = store_.bytes_used();
  if (!used) return;
  bool over = *used > BytesOf(options_.max_gib);
  std::map<std::uint64_t, std::uint64_t> checkpointed;
  {
    const MutexLock lock(mutex_);
    for (const auto& [session, line] : lines_) checkpointed.emplace(session, line.checkpointed);
  }
  for (const auto& [session, position] : checkpointed) {
    if (!over || position == 0) continue;
    const RecordRange range{.kind = RecordKind::kJournal, .owner = session, .first = 0, .last = position};
    const auto removed = store_.RemoveFirst(range, RemovedAtOnce(range.kind));
    if (!removed) continue;
    if (*removed == 0) continue;
    unwanted_.push_back(range);
    budget_checked_ = {};  // It may be enough.
    over = false;
  }
  asking.reset();
  const MutexLock lock(mutex_);
  over_budget_ = over;
  counts_.store_bytes = *used;
}

}  // namespace cairn::server
