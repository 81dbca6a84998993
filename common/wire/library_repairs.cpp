#include "common/wire/library_repairs.h"

#include <fastdds/rtps/builtin/data/ParticipantProxyData.h>
#include <fastdds/rtps/builtin/discovery/participant/PDP.h>
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

}  // namespace eprosima::fastrtps::rtps

#endif
