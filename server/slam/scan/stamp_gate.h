// Lets the samples of one stream pass in strictly increasing order of their stamps, whatever the robot's clock does:
//  - a stamp that repeats or goes back is refused at once;
//  - a sample far ahead of the last one is held back until enough stamps in a row agree with it, then all of them pass
//    and nothing is lost (the stream has paused, or its clock was set ahead); if the old time goes on instead, they are
//    refused: one bad stamp stops nothing;
//  - enough stamps in a row that go back and agree with each other show a clock that was set back: the last of them
//    passes and the stream goes on from there. Numbers tell this from late samples, whose numbers are behind as well.
// Not a clock: decides from stamps and numbers alone. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "common/sensor/stamp.h"
#include "common/service/ledger.h"

namespace cairn::slam {

template <typename Sample>
class StampGate {
 public:
  struct Ports {
    std::function<void(Sample&&)> pass;
    std::function<void(const Sample&, DropReason)> refuse;
    // The next sample to pass is the first of a clock that was set back. `last` is the stamp that passed last.
    std::function<void(Stamp last)> set_back;
  };

  StampGate(std::uint64_t max_jump_ns, std::size_t confirmations, Ports ports)
      : max_jump_ns_(max_jump_ns), confirmations_(confirmations), ports_(std::move(ports)) {}

  // `sequence` 0: not numbered.
  void Add(Stamp stamp, std::uint64_t sequence, Sample&& sample) {
    if (has_last_ && stamp <= last_) return Back(stamp, sequence, std::move(sample));
    if (!has_last_ || NanosBetween(last_, stamp) <= max_jump_ns_) {
      RefuseHeld();
      return Pass({stamp, sequence, std::move(sample)});
    }
    returning_ = 0;
    if (!held_.empty() && !Follows(held_.back().stamp, stamp)) RefuseHeld();
    held_.push_back({stamp, sequence, std::move(sample)});
    if (held_.size() >= confirmations_) PassHeld();
  }

  // At the end of the stream: two samples that agree pass, a single one is refused.
  void Finish() {
    if (held_.size() > 1) return PassHeld();
    RefuseHeld();
  }

  // The next sample comes from another client, which numbers from the beginning.
  void NewClient() { last_sequence_ = 0; }

  // Whether all that has passed lies more than `ns` before this stamp.
  [[nodiscard]] bool IsBefore(Stamp stamp, std::uint64_t ns) const {
    return has_last_ && last_ < stamp && NanosBetween(last_, stamp) > ns;
  }

  // Calls visit(sample) for every sample that was neither passed nor refused yet.
  template <typename Visit>
  void ForEachHeld(const Visit& visit) const {
    for (const Held& held : held_) visit(held.sample);
  }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.has_last_, self.last_, self.last_sequence_, self.held_, self.returning_, self.returned_);
  }

 private:
  struct Held {
    Stamp stamp = 0;
    std::uint64_t sequence = 0;
    Sample sample;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.stamp, self.sequence, self.sample);
    }
  };

  [[nodiscard]] bool Follows(Stamp before, Stamp stamp) const {
    return stamp > before && NanosBetween(before, stamp) <= max_jump_ns_;
  }

  void Back(Stamp stamp, std::uint64_t sequence, Sample&& sample) {
    if (stamp == last_) return ports_.refuse(sample, DropReason::kDuplicateStamp);
    RefuseHeld();
    const bool late = sequence != 0 && sequence <= last_sequence_;
    if (late) return ports_.refuse(sample, DropReason::kStampWentBack);
    const Stamp before = std::exchange(returned_, stamp);
    returning_ = returning_ > 0 && Follows(before, stamp) ? returning_ + 1 : 1;
    if (returning_ < confirmations_) return ports_.refuse(sample, DropReason::kStampWentBack);
    ports_.set_back(last_);
    Pass({stamp, sequence, std::move(sample)});
  }

  void Pass(Held&& next) {
    has_last_ = true;
    last_ = next.stamp;
    if (next.sequence != 0) last_sequence_ = next.sequence;
    returning_ = 0;
    ports_.pass(std::move(next.sample));
  }

  void PassHeld() {
    for (Held& next : std::exchange(held_, {})) Pass(std::move(next));
  }

  void RefuseHeld() {
    for (const Held& refused : std::exchange(held_, {})) ports_.refuse(refused.sample, DropReason::kStampJump);
  }

  const std::uint64_t max_jump_ns_;
  const std::size_t confirmations_;
  const Ports ports_;
  bool has_last_ = false;
  Stamp last_ = 0;
  std::uint64_t last_sequence_ = 0;
  std::vector<Held> held_;     // Ahead of the last one, each following the one before it.
  std::size_t returning_ = 0;  // Stamps in a row that went back and follow each other ...
  Stamp returned_ = 0;         // ... and the last of them.
};

}  // namespace cairn::slam
