#include "client/cli/interrupt.h"

#include <algorithm>
#include <atomic>
#include <csignal>
#include <thread>

namespace cairn::client {
namespace {

std::atomic<bool> interrupted{false};
static_assert(std::atomic<bool>::is_always_lock_free, "written by a signal handler");

extern "C" void OnSignal(int signal_number) {
  interrupted = true;
  std::signal(signal_number, SIG_DFL);
}

}  // namespace

void CatchInterrupts() {
  std::signal(SIGINT, OnSignal);
  std::signal(SIGTERM, OnSignal);
}

bool Interrupted() {
  return interrupted;
}

void WaitUntil(std::chrono::steady_clock::time_point time) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds kStep{50};
  for (auto now = Clock::now(); now < time && !interrupted; now = Clock::now())
    std::this_thread::sleep_for(std::min<Clock::duration>(time - now, kStep));
}

}  // namespace cairn::client
