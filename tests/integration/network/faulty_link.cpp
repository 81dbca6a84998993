#include "tests/integration/network/faulty_link.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <utility>

namespace cairn::test {
namespace {

constexpr std::size_t kMostWaiting = 100'000;  // Frames; beyond, they are lost.
constexpr int kLongestWait_ms = 20;            // So soon the thread sees that it has to stop.

}  // namespace

FaultyLink::FaultyLink(int a, int b, std::uint64_t seed) : a_(a), b_(b), random_(seed) {
  thread_ = std::thread([this] { Carry(); });
}

FaultyLink::~FaultyLink() {
  stop_ = true;
  thread_.join();
}

void FaultyLink::Set(const LinkFaults& faults) {
  const MutexLock lock(mutex_);
  faults_ = faults;
}

LinkFaults FaultyLink::faults() {
  const MutexLock lock(mutex_);
  return faults_;
}

void FaultyLink::Carry() {
  while (!stop_) {
    std::array<pollfd, 2> readable{{{a_, POLLIN, 0}, {b_, POLLIN, 0}}};
    poll(readable.data(), readable.size(), MillisecondsUntilNext());
    const LinkFaults now = faults();
    Take(a_, b_, now);
    Take(b_, a_, now);
    Deliver(now);
  }
}

int FaultyLink::MillisecondsUntilNext() const {
  if (waiting_.empty()) return kLongestWait_ms;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(waiting_.top().due - Clock::now()).count();
  return static_cast<int>(std::clamp<decltype(left)>(left, 0, kLongestWait_ms));
}

void FaultyLink::Take(int from, int to, const LinkFaults& faults) {
  std::array<char, 65536> buffer;
  std::uniform_real_distribution<double> share(0.0, 1.0), spread(-1.0, 1.0);
  for (;;) {
    const ssize_t size = read(from, buffer.data(), buffer.size());
    if (size <= 0) return;
    const bool loses = share(random_) < faults.loss;
    const std::chrono::duration<double> delay(std::max(0.0, faults.delay_s + faults.spread_s * spread(random_)));
    if (loses || faults.cut || waiting_.size() >= kMostWaiting) {
      ++lost_;
      continue;
    }
    waiting_.push({Clock::now() + std::chrono::duration_cast<Clock::duration>(delay), taken_++, to,
                   std::vector<char>(buffer.data(), buffer.data() + size)});
  }
}

void FaultyLink::Deliver(const LinkFaults& faults) {
  while (!waiting_.empty() && (faults.cut || waiting_.top().due <= Clock::now())) {
    const Frame& frame = waiting_.top();
    const bool arrives = !faults.cut && write(frame.to, frame.bytes.data(), frame.bytes.size()) > 0;
    ++(arrives ? carried_ : lost_);
    waiting_.pop();
  }
}

}  // namespace cairn::test
