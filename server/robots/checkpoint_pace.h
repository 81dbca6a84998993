// Decides when the next checkpoint of a session is due. After a crash a server repeats the work that was done since the
// last checkpoint, so checkpoints bound the time of a restart; and each one has a cost, which must stay small beside
// the work. A crash-only system restarts fast because what it has to redo is bounded (Candea and Fox, "Crash-only
// software", 2003).
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>

namespace cairn::server {

class CheckpointPace {
 public:
  using Time = std::chrono::nanoseconds;   // Of the processor.
  static constexpr int kWorkPerCost = 20;  // About one twentieth of the time is spent on checkpoints at most.

  struct Limits {
    std::uint64_t entries = 0;  // Of the journal.
    Time work{};
  };
  explicit CheckpointPace(const Limits& limits) : limits_(limits) {}

  // The estimator has worked for so long, also while a journal was processed again.
  void Worked(Time time) { work_ += time; }
  // Where to say what making the bytes of the last checkpoint has taken. Any thread may write it, also after the
  // session.
  using Cost = std::shared_ptr<std::atomic<Time::rep>>;
  [[nodiscard]] const Cost& cost() const { return cost_; }

  // Whether one is due after the entries up to this position of the journal.
  [[nodiscard]] bool IsDue(std::uint64_t position) const {
    if (position <= newest_ || work_ < next_try_) return false;
    return position >= newest_ + limits_.entries || work_ >= std::max(limits_.work, kWorkPerCost * Time(*cost_));
  }
  // However often it was tried, none could be made for very long, and the journal would grow without end.
  [[nodiscard]] bool IsOverdue(std::uint64_t position) const {
    constexpr std::uint64_t kMostPeriods = 50;
    constexpr int kManyTimes = 100;
    return refused_ >= kManyTimes && position >= newest_ + kMostPeriods * limits_.entries;
  }
  // It could not be made now. It is tried again after some more work, because trying costs as well.
  void Refused() {
    ++refused_;
    next_try_ = work_ + std::max(limits_.work, kWorkPerCost * Time(*cost_)) / 8;
  }
  // One at this position is being written.
  void Begun(std::uint64_t position) {
    newest_ = position;
    refused_ = 0;
    work_ = next_try_ = Time{0};
  }
  // The one on the disk, which the session was restored from. What was processed since then counts as work. Unless it
  // was little, the next checkpoint is due at once: a server that is killed again and again soon after its starts would
  // otherwise repeat more and more work at each of them.
  void RestoredFrom(std::uint64_t position) {
    constexpr int kLittle = 4;  // Part of the work after which a checkpoint is due anyway.
    newest_ = position;
    if (work_ >= limits_.work / kLittle) work_ = std::max(work_, limits_.work);
  }

 private:
  const Limits limits_;
  std::uint64_t newest_ = 0;
  int refused_ = 0;  // Since then.
  Time work_{};
  Time next_try_{};
  const Cost cost_ = std::make_shared<std::atomic<Time::rep>>(0);
};

}  // namespace cairn::server
