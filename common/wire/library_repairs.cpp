#include "common/wire/library_repairs.h"

#include <dlfcn.h>
#include <fastdds/rtps/builtin/data/ParticipantProxyData.h>
#include <fastdds/rtps/builtin/discovery/participant/PDP.h>
#include <fastdds/rtps/history/History.h>
#include <fastdds/rtps/history/ReaderHistory.h>
#include <fastdds/rtps/history/WriterHistory.h>
#include <fastdds/rtps/reader/StatefulReader.h>
#include <fastdds/rtps/resources/TimedEvent.h>
#include <fastdds/rtps/writer/LivelinessManager.h>
#include <fastrtps/fastrtps_dll.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "common/mutex.h"

#if FASTRTPS_VERSION_MAJOR != 2 || FASTRTPS_VERSION_MINOR != 9

namespace cairn::wire {

void UseRepairs() {}

}  // namespace cairn::wire

#else

namespace cairn::wire {
namespace {

using eprosima::fastrtps::ResourceLimitedVector;
using eprosima::fastrtps::rtps::LivelinessData;
using eprosima::fastrtps::rtps::LivelinessManager;
using eprosima::fastrtps::rtps::StatefulReader;
namespace rtps = eprosima::fastrtps::rtps;

// The library's own StatefulReader::processGapMsg, which the dynamic linker finds behind the one below.
using ProcessGap = bool (*)(StatefulReader*, const rtps::GUID_t&, const rtps::SequenceNumber_t&,
                            const rtps::SequenceNumberSet_t&);
ProcessGap LibraryProcessGap() {
  static const auto kFunction = reinterpret_cast<ProcessGap>(
      dlsym(RTLD_NEXT,
            "_ZN8eprosima8fastrtps4rtps14StatefulReader13processGapMsgERKNS1_6GUID_tERKNS1_16SequenceNumber_tERKNS0_"
            "11BitmapRangeIS6_NS1_18SequenceNumberDiffELj256EEE"));
  return kFunction;
}

// Tells of changes of liveliness in the order in which they were made, one after the other. Thread-safe.
class LivelinessNews {
 public:
  using News = std::function<void()>;

  // One for all managers, because a class of the library cannot get a new member. It is never destroyed: threads of the
  // library may still use it while the program ends.
  static LivelinessNews& Instance() {
    static auto& instance = *new LivelinessNews;
    return instance;
  }
  // Called while the manager's own mutex is held, so that the order is that of the changes.
  void Add(const LivelinessManager* manager, News news) {
    const MutexLock lock(mutex_);
    waiting_[manager].news.push_back(std::move(news));
  }
  // Called without the manager's own mutex. What another thread has added while this one tells is told here as well.
  void Tell(const LivelinessManager* manager) {
    mutex_.Lock();
    const auto found = waiting_.find(manager);
    if (found == waiting_.end() || found->second.telling) {
      mutex_.Unlock();
      return;
    }
    found->second.telling = true;  // Nobody else erases it now.
    while (!found->second.news.empty()) {
      const News news = std::move(found->second.news.front());
      found->second.news.pop_front();
      mutex_.Unlock();
      news();
      mutex_.Lock();
    }
    waiting_.erase(found);
    mutex_.Unlock();
  }

 private:
  struct Waiting {
    std::deque<News> news;
    bool telling = false;
  };
  Mutex mutex_;
  std::map<const LivelinessManager*, Waiting> waiting_ CAIRN_GUARDED_BY(mutex_);
};

// Until the next lease runs out. Nothing where no writer is alive.
std::optional<double> MillisecondsUntilTheNextIsDue(const ResourceLimitedVector<LivelinessData>& writers) {
  std::optional<std::chrono::steady_clock::time_point> next;
  for (const LivelinessData& writer : writers) {
    if (writer.status == LivelinessData::WriterStatus::ALIVE) next = std::min(next.value_or(writer.time), writer.time);
  }
  if (!next) return std::nullopt;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(*next - std::chrono::steady_clock::now());
  return static_cast<double>(std::max<std::int64_t>(left.count(), 0));
}

}  // namespace

void UseRepairs() {
  if (LibraryProcessGap() != nullptr) return;
  std::fputs("cairn: this build of Fast DDS 2.9 lacks a function that Cairn needs: StatefulReader::processGapMsg\n",
             stderr);
  std::abort();
}

}  // namespace cairn::wire

namespace eprosima::fastrtps::rtps {

// The thread of timers calls this when a peer's lease may have run out. The library's own version waits for the mutex
// of discovery, while the thread that holds it, because an endpoint of a peer is gone, may wait for the thread of
// timers: then the participant receives nothing any more, for ever (github.com/eProsima/Fast-DDS/issues/6502, open;
// seen with cairnd). This one looks again later where the mutex is not free. Otherwise it does the same. The dynamic
// linker prefers the program's function to that of a shared library.
void PDP::check_remote_participant_liveliness(ParticipantProxyData* peer) {
  constexpr double kLookAgainMs = 20.0;
  std::unique_lock<std::recursive_mutex> guard(*getMutex(), std::try_to_lock);
  if (!guard.owns_lock()) {
    peer->lease_duration_event->update_interval_millisec(kLookAgainMs);
    peer->lease_duration_event->restart_timer();
    return;
  }
  if (peer->m_guid == GUID_t::unknown()) return;
  const auto lease = std::chrono::nanoseconds(peer->m_leaseDuration.to_ns());
  const auto left = peer->last_received_message_tm() + lease - std::chrono::steady_clock::now();
  if (left < std::chrono::steady_clock::duration::zero()) {
    const GUID_t gone = peer->m_guid;
    guard.unlock();
    remove_remote_participant(gone, ParticipantDiscoveryInfo::DROPPED_PARTICIPANT);
    return;
  }
  peer->lease_duration_event->update_interval_millisec(
      static_cast<double>(std::chrono::duration_cast<std::chrono::milliseconds>(left).count()));
  peer->lease_duration_event->restart_timer();
}

// Finds the change `seq` of a writer at `hint` or behind, or returns the place of the next one of that writer. The
// library's own version stops at the first greater number. But a reader that has several writers keeps their changes
// only roughly in order: one that comes late, because it was lost once, stands behind its successor if its writer's
// clock was set back between the two, or if the stamp is forged. Then the arrival was not noticed, the sample was read
// all the same, and an assert ended the process (DataReaderInstance::update_state; seen with cairnd under mutated
// traffic). This one looks farther in readers, but not without end: numbers that are left out are asked for as well.
History::const_iterator History::get_change_nts(const SequenceNumber_t& seq, const GUID_t& guid, CacheChange_t** change,
                                                History::const_iterator hint) const {
  constexpr int kFarther = 1024;
  const bool of_reader = dynamic_cast<const ReaderHistory*>(this) != nullptr;
  *change = nullptr;
  const_iterator next = m_changes.end();
  int looked_at = 0;
  for (const_iterator it = hint; it != m_changes.end() && looked_at < kFarther; ++it) {
    looked_at += next == m_changes.end() ? 0 : 1;
    if ((*it)->writerGUID != guid || (*it)->sequenceNumber < seq) continue;
    if ((*it)->sequenceNumber == seq) {
      *change = *it;
      return it;
    }
    if (next == m_changes.end()) next = it;
    if (!of_reader) break;
  }
  return next;
}

// What a reader keeps of a writer. The library does not install the header of this class, only the function.
class WriterProxy {
 public:
  [[nodiscard]] SequenceNumber_t available_changes_max() const;  // Up to here, all samples have come or are left out.
};

// A writer that keeps the last sample of each key leaves out the numbers between them, and says so again with each of
// its heartbeats. The library's readers go through those numbers one by one each time. With an old key that does not
// change and 200,000 newer samples, that took 36 ms for each heartbeat, and heartbeats come every 20 ms: a reader
// on a busy machine did not acknowledge anything for minutes (seen in a test; github.com/ros2/rmw_fastrtps/issues/789
// describes the same). Here the numbers up to which the reader has everything are passed over, except for the last one:
// the library ignores a message without any, with what it says of later numbers. The mutex is not held while the
// library's own function runs, because listeners that it calls release it.
bool StatefulReader::processGapMsg(const GUID_t& writer, const SequenceNumber_t& first,
                                   const SequenceNumberSet_t& left_out) {
  SequenceNumber_t from = first;
  if (const SequenceNumber_t none(0, 0); none < first && first < left_out.base()) {
    const std::lock_guard<eprosima::fastrtps::RecursiveTimedMutex> lock(getMutex());
    WriterProxy* proxy = nullptr;
    if (matched_writer_lookup(writer, &proxy) && proxy != nullptr)
      from = std::min(std::max(first, proxy->available_changes_max() + 1), left_out.base() - 1);
  }
  return cairn::wire::LibraryProcessGap()(this, writer, from, left_out);
}

// Takes a change out of a history. The library's own version looks for it without the mutex of the history, while other
// threads add changes and remove them. The messages of DDS Security's handshakes with all peers are in one history, and
// the thread of timers sends those again that are not answered. A message that was not found was never sent again: the
// peer was never let in.
CacheChange_t* WriterHistory::remove_change_and_reuse(const SequenceNumber_t& sequence_number) {
  if (mp_writer == nullptr || mp_mutex == nullptr) return nullptr;
  const std::lock_guard<eprosima::fastrtps::RecursiveTimedMutex> lock(*mp_mutex);
  const auto has_number = [&](const CacheChange_t* change) { return change->sequenceNumber == sequence_number; };
  const auto found = std::find_if(m_changes.cbegin(), m_changes.cend(), has_number);
  if (found == m_changes.cend()) return nullptr;
  CacheChange_t* const change = *found;
  remove_change_nts(found, false);
  return change;
}

// The next three functions replace those with which the library notes that a writer is alive, is not, or has gone. It
// changes the state under a mutex and tells of it later, without one. Where a process stood still for longer than a
// lease, the thread of timers says that writers are lost in the moment in which the thread that receives says that they
// are back. The two could arrive in the other order, or as two changes that add up to zero: then a robot counted as
// away for ever although it was there (seen in a test on a loaded machine). Now what happened first is told first. The
// library also kept a pointer to the writer that is due next, into a list from which others are removed; here all that
// are due are looked for instead.
bool LivelinessManager::timer_expired() {
  auto& news = cairn::wire::LivelinessNews::Instance();
  {
    const eprosima::shared_lock<eprosima::shared_mutex> collection(col_mutex_);
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    for (LivelinessData& writer : writers_) {
      if (writer.status != LivelinessData::WriterStatus::ALIVE || writer.time > now) continue;
      writer.status = LivelinessData::WriterStatus::NOT_ALIVE;
      news.Add(this, [this, guid = writer.guid, kind = writer.kind, lease = writer.lease_duration] {
        if (callback_) callback_(guid, kind, lease, -1, 1);
      });
    }
  }
  news.Tell(this);
  const eprosima::shared_lock<eprosima::shared_mutex> collection(col_mutex_);
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto next_ms = cairn::wire::MillisecondsUntilTheNextIsDue(writers_);
  if (next_ms) timer_.update_interval_millisec(*next_ms);
  return next_ms.has_value();
}

bool LivelinessManager::remove_writer(GUID_t guid, LivelinessQosPolicyKind kind, Duration_t lease_duration) {
  auto& news = cairn::wire::LivelinessNews::Instance();
  {
    const std::lock_guard<eprosima::shared_mutex> collection(col_mutex_);
    const std::lock_guard<std::mutex> lock(mutex_);
    auto status = LivelinessData::WriterStatus::NOT_ASSERTED;
    const bool removed = writers_.remove_if([&](LivelinessData& writer) {
      if (writer.guid != guid || writer.kind != kind || !(writer.lease_duration == lease_duration)) return false;
      status = writer.status;
      return --writer.count == 0;
    });
    if (!removed) return false;
    timer_owner_ = nullptr;  // It may have been this one, or one that stands elsewhere now.
    if (status != LivelinessData::WriterStatus::NOT_ASSERTED) {
      const bool was_alive = status == LivelinessData::WriterStatus::ALIVE;
      news.Add(this, [=, this] {
        if (callback_) callback_(guid, kind, lease_duration, was_alive ? -1 : 0, was_alive ? 0 : -1);
      });
    }
  }
  news.Tell(this);
  const eprosima::shared_lock<eprosima::shared_mutex> collection(col_mutex_);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (const auto next_ms = cairn::wire::MillisecondsUntilTheNextIsDue(writers_)) {
    timer_.update_interval_millisec(*next_ms);
    timer_.restart_timer();
  } else {
    timer_.cancel_timer();
  }
  return true;
}

void LivelinessManager::assert_writer_liveliness(LivelinessData& writer) {
  auto& news = cairn::wire::LivelinessNews::Instance();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto before = writer.status;
    writer.status = LivelinessData::WriterStatus::ALIVE;
    writer.time = std::chrono::steady_clock::now() + std::chrono::nanoseconds(writer.lease_duration.to_ns());
    if (before == LivelinessData::WriterStatus::ALIVE) return;
    const int fewer_lost = before == LivelinessData::WriterStatus::NOT_ALIVE ? -1 : 0;
    news.Add(this, [this, guid = writer.guid, kind = writer.kind, lease = writer.lease_duration, fewer_lost] {
      if (callback_) callback_(guid, kind, lease, 1, fewer_lost);
    });
  }
  news.Tell(this);
}

// Readers keep the number of the last sample by the persistence GUID of its writer, where it has one, and participants
// whose GUID is chosen (participant_qos.cpp) get one that is numbered. What damaged traffic says of one that does not
// exist yet would count for it when it joins. Nothing here is persistent in the sense of DDS, so the built-in endpoints
// have none; those of topics have a random one (participant.cpp).
GUID_t ParticipantProxyData::get_persistence_guid() const {
  return c_Guid_Unknown;
}

}  // namespace eprosima::fastrtps::rtps

#endif
