// The journal's thread: takes what waits, and commits it (journal.h).
#include <algorithm>
#include <exception>
#include <iterator>
#include <utility>

#include "server/store/journal.h"

namespace cairn::server {
namespace {

constexpr auto kRetry = std::chrono::seconds(1);
constexpr auto kBudgetPeriod = std::chrono::seconds(10);
constexpr std::size_t kMaxDelays = 4096;

}  // namespace

void Journal::Run(const std::stop_token& stop) {
  while (auto group = Next(stop)) {
    const Clock::time_point oldest = group->oldest;
    try {
      const std::vector<Work> works = std::move(group->works);
      std::optional<WantedCheckpoint> wanted = std::move(group->checkpoint);
      Prepared prepared = Prepare(std::move(*group));
      LeaveOutTooLong(prepared);
      DropForgottenCheckpoint();
      if (!stop.stop_requested()) WriteCheckpoint(std::move(wanted), prepared.changes);
      if (!CommitPatiently(prepared.changes, stop)) return;
      Tell(prepared, oldest);
      if (writing_ && writing_->complete()) {
        EndCheckpoint();
        if (const auto written = std::exchange(written_, nullptr)) written(true);
        budget_checked_ = {};  // The journal before it may be removed now.
      }
      for (const Work& work : works) work(store_);
      KeepBudget();
    } catch (const std::exception& error) {  // For example, not enough memory for the group: the journal ends here.
      const MutexLock lock(mutex_);
      left_out_ = std::string("the journal ended with an exception: ") + error.what();
      ended_ = true;
      for (auto& [session, line] : lines_) Lose(session, line, left_out_);
      return;
    }
  }
}

std::optional<Journal::Group> Journal::Next(const std::stop_token& stop) {
  const auto delay = std::chrono::milliseconds(options_.commit_delay_ms);
  const MutexLock lock(mutex_);
  while (queue_.empty() && checkpoints_.empty() && works_.empty() && !writing_ && !stop.stop_requested())
    arrived_.Wait(mutex_);
  if (queue_.empty() && stop.stop_requested()) return std::nullopt;
  const auto due = oldest_ + delay;
  while (!queue_.empty() && !urgent_ && !writing_ && !stop.stop_requested() && Clock::now() < due)
    arrived_.WaitUntil(mutex_, due);
  urgent_ = false;
  committing_bytes_ = std::exchange(queued_bytes_, 0);
  Group group{std::exchange(queue_, {}), std::exchange(works_, {}), std::nullopt, oldest_};
  // Together with the queue: the entries before a checkpoint are in this group or in an earlier one.
  if (!writing_ && !checkpoints_.empty()) {
    group.checkpoint = std::move(checkpoints_.front());
    checkpoints_.pop_front();
  }
  return group;
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
      std::erase_if(put, [range](const auto& one) {
        const RecordKey& key = one.first;
        return key.kind == range->kind && key.owner == range->owner && key.number >= range->first &&
               key.number <= range->last;
      });
      if (range->kind == RecordKind::kJournal) batches.erase(range->owner);
      prepared.changes.removed.push_back(*range);
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
// with neither checkpoint nor journal it would begin where its robot once stood; and without the journal before it,
// which has a gap.
void Journal::AddRecovered(std::uint64_t session, RecordChanges& changes) {
  const MutexLock lock(mutex_);
  const auto line = lines_.find(session);
  if (line == lines_.end() || line->second.recovers_at != writing_->position()) return;
  if (line->second.unwritten)
    changes.put.push_back({{RecordKind::kSession, session, 0}, BytesOf(*line->second.unwritten)});
  changes.removed.push_back(
      {.kind = RecordKind::kJournal, .owner = session, .first = 0, .last = line->second.recovers_at});
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
  const auto committed = store_.Commit(changes);
  const MutexLock lock(mutex_);
  disk_fault_ = committed ? std::string() : committed.error().message;
  ++(committed ? counts_.commits : counts_.failed_commits);
  return committed.has_value();
}

bool Journal::CommitPatiently(const RecordChanges& changes, const std::stop_token& stop) {
  while (!CommitOnce(changes)) {
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
    delays_ms_.push_back(std::chrono::duration<float, std::milli>(Clock::now() - oldest).count());
    if (delays_ms_.size() > kMaxDelays) delays_ms_.pop_front();
    for (const auto& [session, batch] : prepared.batches) {
      counts_.entries += batch.entries.size();
      const auto line = lines_.find(session);
      if (line != lines_.end() && line->second.durable) told.emplace_back(line->second.durable, &batch);
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
      ReleaseHeld(writing_->session(), line->second);
    }
  }
  checkpoint_fault_.clear();
  writing_.reset();
}

void Journal::KeepBudget() {
  if (Clock::now() - budget_checked_ < kBudgetPeriod) return;
  budget_checked_ = Clock::now();
  const std::uint64_t limit = BytesOf(options_.max_gib);
  std::map<std::uint64_t, std::uint64_t> checkpointed;
  {
    const MutexLock lock(mutex_);
    for (const auto& [session, line] : lines_) checkpointed.emplace(session, line.checkpointed);
  }
  for (const auto& [session, position] : checkpointed) {
    const auto used = store_.bytes_used();
    if (!used) return;
    if (*used <= limit) break;
    if (position == 0) continue;
    CommitOnce(
        {.removed = {{.kind = RecordKind::kJournal, .owner = session, .first = 0, .last = position}}, .put = {}});
  }
  const auto used = store_.bytes_used();
  if (!used) return;
  const MutexLock lock(mutex_);
  over_budget_ = *used > limit;
}

}  // namespace cairn::server
