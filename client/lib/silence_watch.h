// Notices that a subscription receives nothing although the server has something new: forged messages can bring a
// reader of DDS into such a state, and it does not get out of it by itself. After a second of silence the watch asks
// the server, and where the client is behind twice in a row, it has the client join the domain anew. It asks again
// after two seconds, and later and later, up to once a minute, where joining did not help. While forged messages
// arrive, which may make it deaf again, it waits eight seconds after it has joined, or until they have stopped. For
// some time after them it asks twice a second: a robot's stream may have stood still as well, so that the server has
// new poses only when that flows again. Thread rule: Arrived from any thread, Stop from one. The functions run on the
// watch's thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <thread>

#include "client/lib/query_client.h"
#include "common/mutex.h"
#include "common/wire/bus.h"

namespace cairn::client {

class SilenceWatch {
 public:
  // `behind` asks the server whether it has something newer than what arrived; false where it does not answer. `bus`
  // outlives the watch.
  SilenceWatch(wire::Bus& bus, std::function<bool(QueryClient& queries)> behind, std::function<void()> renew);
  ~SilenceWatch() { Stop(); }
  SilenceWatch(const SilenceWatch&) = delete;
  SilenceWatch& operator=(const SilenceWatch&) = delete;

  // Something new arrived.
  void Arrived();
  // Ends the thread; no function runs afterwards.
  void Stop();

 private:
  using Clock = std::chrono::steady_clock;

  void Run();
  // Waits until it is time to ask. Returns false if the watch ends.
  bool WaitForSilence(Clock::time_point next_question);
  bool RestWhileHostile();
  bool IsBehind();
  // Looks whether forged messages were refused since the last question. Returns whether that was so lately.
  bool NoteRefusals(Clock::time_point now);

  wire::Bus& bus_;
  const std::function<bool(QueryClient& queries)> behind_;
  const std::function<void()> renew_;
  Mutex mutex_;
  CondVar stopped_;
  Clock::time_point last_arrival_ CAIRN_GUARDED_BY(mutex_) = Clock::now();
  bool stopping_ CAIRN_GUARDED_BY(mutex_) = false;
  // Used by the thread only.
  std::unique_ptr<QueryClient> queries_;  // From the first silence on.
  std::uint64_t seen_refused_ = 0;
  Clock::time_point alert_until_{};
  std::thread thread_;  // Last: it uses everything above.
};

}  // namespace cairn::client
