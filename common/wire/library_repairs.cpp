#include "common/wire/library_repairs.h"

#include <fastdds/rtps/builtin/data/ParticipantProxyData.h>
#include <fastdds/rtps/builtin/discovery/participant/PDP.h>
#include <fastdds/rtps/history/History.h>
#include <fastdds/rtps/history/ReaderHistory.h>
#include <fastdds/rtps/resources/TimedEvent.h>
#include <fastrtps/fastrtps_dll.h>

#include <chrono>
#include <mutex>

namespace cairn::wire {

void UseRepairs() {}

}  // namespace cairn::wire

#if FASTRTPS_VERSION_MAJOR == 2 && FASTRTPS_VERSION_MINOR == 9

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

}  // namespace eprosima::fastrtps::rtps

#endif
