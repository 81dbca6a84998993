// The part of QueryClient that joins the domain anew where it may be deaf (query_client.h).
#include <algorithm>
#include <utility>

#include "client/lib/query_client.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kJoinPatience{6};  // No server is found for so long; a handshake takes 1 s.
// Where forged messages may have made the client deaf.
constexpr std::chrono::seconds kHostileJoinPatience{2};
// Between two times that it joins anew: a new participant needs some time, and it may be slow or deaf for another
// reason.
constexpr std::chrono::seconds kHostilePause{2}, kLongestHostilePause{4};

}  // namespace

// Whether forged messages may have made this client deaf: its participant has refused some. A new participant has not.
bool QueryClient::MayBeDeaf() {
  return CurrentWire()->bus->datagrams_refused() > 0;
}

// `began`: since when there has been no answer.
void QueryClient::RenewIfSilent(Deadline began, std::chrono::seconds patience) {
  constexpr std::chrono::seconds kLongestPause{60};  // A server may be silent for another reason.
  const bool hostile = MayBeDeaf();
  {
    const MutexLock lock(mutex_);
    const auto now = Clock::now();
    const auto pause =
        hostile ? std::clamp(renewal_pause_, kHostilePause, kLongestHostilePause) : std::max(patience, renewal_pause_);
    if (now - std::max(began, last_answer_) < patience || now - renewed_ < pause) return;
    renewed_ = now;
    // While forged messages arrive it stays short, because each new participant may be stopped like the one before.
    renewal_pause_ = std::min(2 * renewal_pause_, hostile ? kLongestHostilePause : kLongestPause);
    if (alone_since_) alone_since_ = now;
  }
  auto bus = wire::Bus::Create(bus_.options(), "questions");
  if (!bus) return;
  auto wire = Connect(**bus);
  if (!wire) return;
  (*wire)->own = std::move(*bus);
  std::shared_ptr<Wire> before;  // Its callbacks take the mutex: it goes when the lock is released.
  {
    const MutexLock lock(mutex_);
    before = std::exchange(wire_, std::move(*wire));
    ++times_renewed_;
  }
}

void QueryClient::RenewIfAlone(bool secure) {
  std::optional<Deadline> alone_since;
  {
    const MutexLock lock(mutex_);
    alone_since = alone_since_;
  }
  if (!alone_since) return;
  if (MayBeDeaf()) {
    RenewIfSilent(*alone_since, kHostileJoinPatience);
  } else if (secure) {
    RenewIfSilent(*alone_since, kJoinPatience);
  }
}

}  // namespace cairn::client
