#include "client/lib/silence_watch.h"

#include <algorithm>
#include <utility>

namespace cairn::client {
namespace {

constexpr std::chrono::seconds kSilence{1};
constexpr std::chrono::seconds kRest{2};  // Between two questions that find nothing new.
constexpr std::chrono::seconds kLongestRest{60};
// While forged messages arrive, and as soon as they stop.
constexpr std::chrono::seconds kLongestHostileRest{8};
constexpr std::chrono::seconds kShortestHostileRest{1};
constexpr std::chrono::milliseconds kLook{
    500};  // They come by the thousand: so long without one, and they have stopped.
// The time between two questions where forged messages were refused within the last kAlertFor.
constexpr std::chrono::milliseconds kAlertRest{500};
constexpr std::chrono::seconds kAlertFor{15};

}  // namespace

SilenceWatch::SilenceWatch(wire::Bus& bus, std::function<bool(QueryClient& queries)> behind,
                           std::function<void()> renew)
    : bus_(bus), behind_(std::move(behind)), renew_(std::move(renew)), thread_([this] { Run(); }) {}

void SilenceWatch::Stop() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    stopped_.NotifyAll();
  }
  if (thread_.joinable()) thread_.join();
}

void SilenceWatch::Arrived() {
  const MutexLock lock(mutex_);
  last_arrival_ = Clock::now();
}

bool SilenceWatch::WaitForSilence(Clock::time_point next_question) {
  const MutexLock lock(mutex_);
  while (!stopping_) {
    const auto due = std::max(next_question, last_arrival_ + kSilence);
    if (Clock::now() >= due) return true;
    stopped_.WaitUntil(mutex_, due);
  }
  return false;
}

// The rest after joining anew where forged messages arrived. Returns false if the watch ends.
bool SilenceWatch::RestWhileHostile() {
  const auto start = Clock::now();
  std::uint64_t refused = bus_.datagrams_refused();
  for (auto look = start + kShortestHostileRest; look < start + kLongestHostileRest; look += kLook) {
    {
      const MutexLock lock(mutex_);
      while (!stopping_ && Clock::now() < look) stopped_.WaitUntil(mutex_, look);
      if (stopping_) return false;
    }
    const std::uint64_t refused_before = std::exchange(refused, bus_.datagrams_refused());
    if (refused == refused_before) break;
  }
  return true;
}

bool SilenceWatch::NoteRefusals(Clock::time_point now) {
  const std::uint64_t refused = bus_.datagrams_refused();
  if (std::exchange(seen_refused_, refused) != refused) alert_until_ = now + kAlertFor;
  return now < alert_until_;
}

bool SilenceWatch::IsBehind() {
  if (queries_ == nullptr) {
    auto queries = QueryClient::Create(bus_);
    if (!queries) return false;
    queries_ = std::move(*queries);
  }
  return behind_(*queries_);
}

void SilenceWatch::Run() {
  Clock::duration after_renewal = kRest;
  Clock::time_point next_question = Clock::now();
  std::uint64_t refused = bus_.datagrams_refused();
  seen_refused_ = refused;
  // The second question may come early only once, until the client is no longer behind: a robot that sends few poses,
  // or a participant that has just joined, needs the whole kSilence.
  bool patient = false;
  while (WaitForSilence(next_question)) {
    const auto asked = Clock::now();
    const bool alert = NoteRefusals(asked);
    next_question = asked + (alert ? Clock::duration(kAlertRest) : kRest);
    if (!IsBehind()) {
      after_renewal = kRest;
      patient = false;
      continue;
    }
    // What is on its way has some time to arrive; then WaitForSilence waits for the next silence.
    if (!WaitForSilence(asked + (alert && !patient ? Clock::duration(kAlertRest) : kSilence))) return;
    patient = true;
    {
      const MutexLock lock(mutex_);
      if (last_arrival_ > asked) continue;
    }
    if (!IsBehind()) continue;
    renew_();
    const std::uint64_t refused_before = std::exchange(refused, bus_.datagrams_refused());
    if (refused > refused_before) {
      if (!RestWhileHostile()) return;
      next_question = Clock::now();
    } else {
      next_question = Clock::now() + after_renewal;
      after_renewal = std::min<Clock::duration>(2 * after_renewal, kLongestRest);
    }
  }
}

}  // namespace cairn::client
