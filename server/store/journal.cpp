#include "server/store/journal.h"

#include <algorithm>
#include <exception>
#include <iterator>
#include <utility>

namespace cairn::server {
namespace {

constexpr std::chrono::seconds kLongestAnswer{5};
constexpr const char* kHangs = "the disk has not answered for more than 5 s: what robots send is not durable";
constexpr const char* kTooSlow =
    "the disk was too slow or failed for too long, and a part of the state is no longer stored";

// The cells of a grid are not counted: they are shared with the map.
std::size_t SizeOf(const JournalEntry& entry) {
  constexpr std::size_t kSmall = 256;
  if (const auto* const scan = std::get_if<ScanTaken>(&entry)) {
    return kSmall + sizeof(float) * scan->scan->ranges_m.size();
  }
  const auto* localise = std::get_if<LocaliseTaken>(&entry);
  if (const auto* const suggested = std::get_if<PlaceSuggested>(&entry)) localise = &suggested->map;
  if (localise != nullptr) {
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
  line.unwritten = session;
  const RecordKey key{RecordKind::kSession, session.id, 0};
  // Nothing that an earlier session of this number may have left can become a part of this one.
  if (RemoveStatesOf(session.id, 1024, Room::kForSamples)) {
    // The caller is told as soon as the session itself is on the disk.
    PushRecord(
        key, [session] { return BytesOf(session); }, 0, Room::kForSamples);
  } else {
    Lose(session.id, line, kTooSlow);
  }
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
  const auto found = lines_.find(session);
  if (found == lines_.end() || !found->second.lost.empty()) return 0;
  Line& line = found->second;
  if (line.recovers_at == 0) {
    if (!Push(Appended{session, line.next, std::move(entry)}, size)) {
      Lose(session, line, kTooSlow);
      return 0;
    }
  } else if (HasRoom(size, Room::kForSamples)) {
    held_.push_back({session, line.next, std::move(entry)});
    held_bytes_ += size;
  } else {
    Lose(session, line, kTooSlow);
    return 0;
  }
  return line.next++;
}

std::uint64_t Journal::position(std::uint64_t session) const {
  const MutexLock lock(mutex_);
  const auto line = lines_.find(session);
  return line == lines_.end() || !line->second.lost.empty() ? 0 : line->second.next - 1;
}

bool Journal::Checkpoint(std::uint64_t session, std::uint64_t position, Content content, Done done) {
  const MutexLock lock(mutex_);
  const auto line = lines_.find(session);
  if (line == lines_.end() || !line->second.lost.empty() || line->second.checkpointing) return false;
  // Nothing new; and to write it again would first remove the one that is there.
  if (position <= line->second.checkpointed) return false;
  line->second.checkpointing = true;
  checkpoints_.push_back({session, position, std::move(content), std::move(done)});
  arrived_.NotifyAll();
  return true;
}

std::uint64_t Journal::Recover(std::uint64_t session) {
  const MutexLock lock(mutex_);
  const auto found = lines_.find(session);
  if (found == lines_.end() || found->second.lost.empty() || !disk_fault_.empty()) return 0;
  Line& line = found->second;
  // A checkpoint that was asked for before has another position.
  if (line.checkpointing || !HasRoom(BytesOfQueue() / 2, Room::kForSamples)) return 0;
  if (line.unwritten && !RemoveStatesOf(session, 256, Room::kForSamples)) return 0;
  line.lost.clear();
  line.recovers_at = line.next++;
  return line.recovers_at;
}

void Journal::Abandon(std::uint64_t session) {
  const MutexLock lock(mutex_);
  if (const auto line = lines_.find(session); line != lines_.end()) Lose(session, line->second, kTooSlow);
}

bool Journal::IsLost(std::uint64_t session) const {
  const MutexLock lock(mutex_);
  const auto line = lines_.find(session);
  return line != lines_.end() && !line->second.lost.empty();
}

bool Journal::IsCheckpointing(std::uint64_t session) const {
  const MutexLock lock(mutex_);
  const auto line = lines_.find(session);
  return line != lines_.end() && line->second.checkpointing;
}

void Journal::Lose(std::uint64_t session, Line& line, std::string why) {
  line.lost = std::move(why);
  line.recovers_at = 0;
  std::erase_if(held_, [&](const Appended& appended) CAIRN_NO_THREAD_SAFETY_ANALYSIS {
    if (appended.session != session) return false;
    held_bytes_ -= SizeOf(appended.entry);
    return true;
  });
}

// The checkpoint is on the disk, so what came after it can follow. What is before it has a gap.
void Journal::ReleaseHeld(std::uint64_t session, Line& line) {
  line.recovers_at = 0;
  std::erase_if(held_, [&](Appended& appended) CAIRN_NO_THREAD_SAFETY_ANALYSIS {
    if (appended.session != session) return false;
    const std::size_t size = SizeOf(appended.entry);
    held_bytes_ -= size;
    queued_bytes_ += size;
    queue_.push_back(std::move(appended));
    return true;
  });
}

void Journal::Close(std::uint64_t session) {
  const MutexLock lock(mutex_);
  CloseLocked(session);
}

void Journal::CloseLocked(std::uint64_t session) {
  if (const auto line = lines_.find(session); line != lines_.end()) Lose(session, line->second, {});
  lines_.erase(session);
  std::erase_if(checkpoints_, [session](const WantedCheckpoint& wanted) { return wanted.session == session; });
}

void Journal::Between(Work work) {
  const MutexLock lock(mutex_);
  works_.push_back(std::move(work));
  urgent_ = true;
  arrived_.NotifyAll();
}

bool Journal::HasTimeToSpare() const {
  const MutexLock lock(mutex_);
  return HasRoom(BytesOfQueue() / 2, Room::kForSamples);
}

void Journal::WhenStored(std::function<void()> told) {
  const MutexLock lock(mutex_);
  told_.push_back(std::move(told));
  urgent_ = true;
  arrived_.NotifyAll();
}

void Journal::Forget(std::uint64_t session) {
  const MutexLock lock(mutex_);
  CloseLocked(session);
  Push(Forgotten{session}, 256, Room::kWithReserve);
}

// Removes what belongs to a session besides its own record. `size` is that of the whole change, so that what follows
// at once finds room as well.
bool Journal::RemoveStatesOf(std::uint64_t session, std::size_t size, Room room) {
  if (!Push(AllOf(RecordKind::kJournal, session), size, room)) return false;
  return Push(AllOf(RecordKind::kCheckpoint, session), 0, room) &&
         Push(AllOf(RecordKind::kRestoring, session), 0, room) && Push(AllOf(RecordKind::kRemoved, session), 0, room);
}

void Journal::Put(const RecordKey& key, Bytes bytes, std::size_t size) {
  const MutexLock lock(mutex_);
  PushRecord(key, std::move(bytes), size, Room::kWithReserve);
}

void Journal::Remove(const RecordRange& range) {
  const MutexLock lock(mutex_);
  Push(range, 64, Room::kWithReserve);
}

bool Journal::Apply(Edit edit) {
  constexpr std::size_t kSize = 1024;
  const MutexLock lock(mutex_);
  for (const std::uint64_t session : edit.forgotten) CloseLocked(session);
  if (!HasRoom(kSize * (edit.put.size() + 1), Room::kWithReserve)) {
    if (edit.put.empty()) left_out_ = kTooSlow;
    for (const auto& [key, bytes] : edit.put) omitted_.insert(key);
    return false;
  }
  for (const RecordRange& range : edit.removed) Push(range, 0, Room::kWithReserve);
  for (auto& [key, bytes] : edit.put) PushRecord(key, std::move(bytes), kSize, Room::kWithReserve);
  for (const std::uint64_t session : edit.forgotten) Push(Forgotten{session}, 0, Room::kWithReserve);
  return true;
}

std::size_t Journal::BytesOfQueue() const {
  return static_cast<std::size_t>(options_.queue_mib) << 20;
}

bool Journal::HasRoom(std::size_t size, Room room) const {
  const std::size_t bound = room == Room::kWithReserve ? 2 * BytesOfQueue() : BytesOfQueue();
  return queued_bytes_ + committing_bytes_ + held_bytes_ + size <= bound;
}

// All changes of the queue are committed together, so that only the last form of a record reaches the disk.
bool Journal::PushRecord(const RecordKey& key, Bytes bytes, std::size_t size, Room room) {
  if (const auto older = queued_records_.find(key); older != queued_records_.end()) {
    Written& written = std::get<Written>(*older->second);
    written.bytes = std::move(bytes);
    queued_bytes_ += size - std::min(size, written.size);
    written.size = std::max(size, written.size);
    queue_.splice(queue_.end(), queue_, older->second);  // After removals that came meanwhile.
    omitted_.erase(key);
    return true;
  }
  if (!HasRoom(size, room)) {
    omitted_.insert(key);
    return false;
  }
  if (!Push(Written{key, std::move(bytes), size}, size, room)) return false;
  queued_records_[key] = std::prev(queue_.end());
  omitted_.erase(key);
  return true;
}

bool Journal::Push(Change change, std::size_t size, Room room) {
  if (!HasRoom(size, room)) {
    if (room == Room::kWithReserve) left_out_ = kTooSlow;
    return false;
  }
  if (const auto* const range = std::get_if<RecordRange>(&change)) {
    std::erase_if(omitted_, [range](const RecordKey& key) { return range->Covers(key); });
  } else if (const auto* const forgotten = std::get_if<Forgotten>(&change)) {
    omitted_.erase({RecordKind::kSession, forgotten->session, 0});
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
  std::string lost;
  for (const auto& [session, line] : lines_) {
    if (!line.lost.empty()) lost = line.lost;
    if (line.recovers_at != 0 && lost.empty())
      lost = "what a session has done while the disk failed is not on the disk yet";
  }
  const std::string omitted = omitted_.empty() ? std::string() : kTooSlow;
  const bool hangs = asking_since_ && Clock::now() - *asking_since_ > kLongestAnswer;
  const std::string hanging = hangs ? kHangs : std::string();
  JournalHealth health{.degraded = false,
                       .reason = {},
                       .disk_fails = !disk_fault_.empty(),
                       .disk_hangs = hangs,
                       .over_budget = over_budget_};
  for (const std::string& reason : {disk_fault_, hanging, left_out_, omitted, lost, checkpoint_fault_}) {
    if (reason.empty()) continue;
    health.degraded = true;
    health.reason = reason;
    break;
  }
  return health;
}

JournalCounts Journal::counts() const {
  const MutexLock lock(mutex_);
  JournalCounts counts = counts_;
  const DelayMeter::Quantiles delays = delays_.quantiles();
  counts.delay_p50_ms = delays.p50_ms;
  counts.delay_p99_ms = delays.p99_ms;
  return counts;
}

}  // namespace cairn::server
