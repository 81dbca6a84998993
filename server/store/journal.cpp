#include "server/store/journal.h"

#include <algorithm>
#include <exception>
#include <iterator>
#include <utility>

namespace cairn::server {
namespace {

constexpr auto kRetry = std::chrono::seconds(1);
constexpr auto kBudgetPeriod = std::chrono::seconds(10);
constexpr std::size_t kMaxDelays = 4096;

// The cells of a grid are not counted: they are shared with the map.
std::size_t SizeOf(const JournalEntry& entry) {
  constexpr std::size_t kSmall = 256;
  if (const auto* const scan = std::get_if<ScanTaken>(&entry)) {
    return kSmall + sizeof(float) * scan->scan->ranges_m.size();
  }
  if (const auto* const localise = std::get_if<LocaliseTaken>(&entry)) {
    std::size_t size = kSmall;
    for (const auto& tile : localise->tiles) size += kSmall + tile->bytes.size();
    return size;
  }
  return kSmall;
}

RecordRange AllOf(RecordKind kind, std::uint64_t owner) {
  return {.kind = kind, .owner = owner};
}

}  // namespace

Journal::Journal(Store& store, const StoreOptions& options) : store_(store), options_(options) {}

Journal::~Journal() {
  Stop();
}

void Journal::Start() {
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

void Journal::Stop() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  {
    const MutexLock lock(mutex_);
    arrived_.NotifyAll();
  }
  thread_.join();
}

void Journal::Open(const StoredSession& session, Durable durable) {
  const MutexLock lock(mutex_);
  Line& line = lines_[session.id] = Line{.next = 1, .durable = std::move(durable)};
  const RecordKey key{RecordKind::kSession, session.id, 0};
  // Nothing that an earlier session of this number may have left can become a part of this one.
  line.lost = !RemoveStatesOf(session.id, 1024, Room::kForSamples);
  // The caller is told as soon as the session itself is on the disk.
  if (!line.lost) Push(Written{key, [session] { return BytesOf(session); }}, 0);
  urgent_ = true;
  arrived_.NotifyAll();
}

void Journal::Reopen(std::uint64_t session, std::uint64_t last, Durable durable, std::uint64_t checkpointed,
                     StoredPieces pieces) {
  const MutexLock lock(mutex_);
  lines_[session] =
      Line{.next = last + 1, .checkpointed = checkpointed, .pieces = std::move(pieces), .durable = std::move(durable)};
}

std::uint64_t Journal::Append(std::uint64_t session, JournalEntry entry) {
  const std::size_t size = SizeOf(entry);
  const MutexLock lock(mutex_);
  const auto line = lines_.find(session);
  if (line == lines_.end() || line->second.lost) return 0;
  if (!Push(Appended{session, line->second.next, std::move(entry)}, size)) {
    line->second.lost = true;
    return 0;
  }
  return line->second.next++;
}

std::uint64_t Journal::position(std::uint64_t session) const {
  const MutexLock lock(mutex_);
  const auto line = lines_.find(session);
  return line == lines_.end() || line->second.lost ? 0 : line->second.next - 1;
}

bool Journal::Checkpoint(std::uint64_t session, std::uint64_t position, Content content) {
  const MutexLock lock(mutex_);
  const auto line = lines_.find(session);
  if (line == lines_.end() || line->second.lost || line->second.checkpointing) return false;
  // Nothing new; and to write it again would first remove the one that is there.
  if (position <= line->second.checkpointed) return false;
  line->second.checkpointing = true;
  checkpoints_.push_back({session, position, std::move(content)});
  arrived_.NotifyAll();
  return true;
}

void Journal::Close(std::uint64_t session) {
  const MutexLock lock(mutex_);
  CloseLocked(session);
}

void Journal::CloseLocked(std::uint64_t session) {
  lines_.erase(session);
  std::erase_if(checkpoints_, [session](const WantedCheckpoint& wanted) { return wanted.session == session; });
}

void Journal::Between(Work work) {
  const MutexLock lock(mutex_);
  works_.push_back(std::move(work));
  urgent_ = true;
  arrived_.NotifyAll();
}

void Journal::Forget(std::uint64_t session) {
  const MutexLock lock(mutex_);
  CloseLocked(session);
  if (RemoveStatesOf(session, 256, Room::kWithReserve))
    Push(AllOf(RecordKind::kSession, session), 0, Room::kWithReserve);
}

// Removes what belongs to a session besides its own record. `size` is that of the whole change, so that what follows
// at once finds room as well.
bool Journal::RemoveStatesOf(std::uint64_t session, std::size_t size, Room room) {
  if (!Push(AllOf(RecordKind::kJournal, session), size, room)) return false;
  return Push(AllOf(RecordKind::kCheckpoint, session), 0, room) &&
         Push(AllOf(RecordKind::kRestoring, session), 0, room);
}

void Journal::Put(const RecordKey& key, Bytes bytes, std::size_t size) {
  const MutexLock lock(mutex_);
  Push(Written{key, std::move(bytes)}, size, Room::kWithReserve);
}

void Journal::Remove(const RecordRange& range) {
  const MutexLock lock(mutex_);
  Push(range, 64, Room::kWithReserve);
}

bool Journal::Push(Change change, std::size_t size, Room room) {
  const std::size_t bound = static_cast<std::size_t>(options_.queue_mib) << (room == Room::kWithReserve ? 21 : 20);
  if (queued_bytes_ + committing_bytes_ + size > bound) {
    lost_ = "the disk was too slow or failed for too long, and a part of the state is no longer stored";
    return false;
  }
  // Only the first change of a group wakes the thread, which then sleeps until the group is due.
  if (queue_.empty()) {
    oldest_ = Clock::now();
    arrived_.NotifyAll();
  }
  queue_.push_back(std::move(change));
  queued_bytes_ += size;
  return true;
}

JournalHealth Journal::health() const {
  const MutexLock lock(mutex_);
  for (const std::string& reason : {disk_fault_, lost_, checkpoint_fault_})
    if (!reason.empty()) return {.degraded = true, .reason = reason, .over_budget = over_budget_};
  return {.degraded = false, .reason = {}, .over_budget = over_budget_};
}

JournalCounts Journal::counts() const {
  const MutexLock lock(mutex_);
  JournalCounts counts = counts_;
  if (delays_ms_.empty()) return counts;
  std::vector<float> sorted(delays_ms_.begin(), delays_ms_.end());
  std::sort(sorted.begin(), sorted.end());
  counts.delay_p50_ms = sorted[(sorted.size() - 1) / 2];
  counts.delay_p99_ms = sorted[(sorted.size() - 1) * 99 / 100];
  return counts;
}

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
        budget_checked_ = {};  // The journal before it may be removed now.
      }
      for (const Work& work : works) work(store_);
      KeepBudget();
    } catch (const std::exception& error) {  // For example, not enough memory for the group: the journal ends here.
      const MutexLock lock(mutex_);
      lost_ = std::string("the journal ended with an exception: ") + error.what();
      for (auto& [session, line] : lines_) line.lost = true;
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
    lost_ = "a record is too long for the store and was left out, of kind " +
            std::to_string(static_cast<int>(record.key.kind)) + " and owner " + std::to_string(record.key.owner) +
            ", with " + std::to_string(record.bytes.size()) + " bytes";
    const bool of_session = record.key.kind == RecordKind::kJournal || record.key.kind == RecordKind::kSession;
    if (of_session) {
      prepared.batches.erase(record.key.owner);  // It is not told that these entries are on the disk.
      if (const auto line = lines_.find(record.key.owner); line != lines_.end()) line->second.lost = true;
    }
    return true;
  });
}

// The parts of a checkpoint that are written already are removed with the session.
void Journal::DropForgottenCheckpoint() {
  const MutexLock lock(mutex_);
  if (writing_ && !lines_.contains(writing_->session())) writing_.reset();
}

// Adds the next records of the checkpoint that is being written, or of a new one. One that cannot be made, for example
// because memory is short, is left out: the one before it stays, and the journal goes on.
void Journal::WriteCheckpoint(std::optional<WantedCheckpoint> wanted, RecordChanges& changes) {
  if (!wanted && !writing_) return;
  const std::uint64_t session = writing_ ? writing_->session() : wanted->session;
  try {
    if (wanted) BeginCheckpoint(std::move(*wanted));
    RecordChanges records;
    if (writing_) writing_->AddTo(records);
    std::ranges::move(records.removed, std::back_inserter(changes.removed));
    std::ranges::move(records.put, std::back_inserter(changes.put));
  } catch (const std::exception& error) {
    const MutexLock lock(mutex_);
    checkpoint_fault_ = std::string("the last checkpoint could not be made: ") + error.what();
    if (const auto line = lines_.find(session); line != lines_.end()) line->second.checkpointing = false;
    writing_.reset();
  }
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
