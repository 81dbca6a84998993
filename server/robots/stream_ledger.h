// The account of one stream (robot, sensor): what became of every sample, scan or odometry. `received + lost_on_wire` =
// `used + dropped + waiting` at every moment.
//
// Numbers: samples carry sequences from 1. A gap counts as lost_on_wire and settles at once, so a client's window never
// hangs on it; a late arrival takes its number back out of the lost. A number seen before (a resend of something
// already received) is ignored and counted nowhere. At most kMaxGaps separate gaps are remembered; older ones stay lost
// for good. Numbers before the first one of a client may have gone to an earlier session or to the server before its
// last restart. They do not count as lost, and are taken if they come late. The counts go on. A number
// more than kMaxStep ahead begins anew in the same way: no client loses a million scans at once.
// Thread rule: none of its own; the session's lock guards it.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "common/service/ledger.h"

namespace cairn::server {

class StreamLedger {
 public:
  static constexpr std::size_t kMaxGaps = 1024;
  static constexpr std::uint64_t kMaxStep = 1'000'000;

  explicit StreamLedger(Ledger names) : ledger_(std::move(names)) {}

  // A scan arrived; false for a duplicate number, which the caller forgets. Otherwise Used or Dropped must follow.
  bool Received(std::uint64_t sequence);
  void Used(std::uint64_t sequence, Stamp stamp, bool keyframe, double latency_ms);
  // As above, for odometry: no latency is measured.
  void Used(std::uint64_t sequence, Stamp stamp);
  void Dropped(std::uint64_t sequence, DropReason reason);
  // A scan of someone else's client under this stream's name: counted, its number means nothing here.
  void DroppedForeign(DropReason reason);

  // The account as a checkpoint needs it, which holds what the journal does: of the waiting numbers only those in
  // `taken` are in the journal. The others are taken back, as if they had never come, because the journal's later
  // entries or the client bring them again. Nothing where that cannot be said exactly; a later moment will do.
  [[nodiscard]] std::optional<StreamLedger> AsJournaled(const std::set<std::uint64_t>& taken) const;
  [[nodiscard]] const std::set<std::uint64_t>& waiting() const { return waiting_; }
  // For checkpoints (slam/state/archive.h). The names, the latencies and what is on the disk are not part of it.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    auto& ledger = self.ledger_;
    archive(ledger.received, ledger.used, ledger.keyframes, ledger.dropped, ledger.last_sequence,
            ledger.settled_through, ledger.last_stamp, self.begun_, self.first_sequence_, self.settled_count_,
            self.waiting_);
    std::vector<std::uint64_t> gaps;  // First and last missing number of each.
    for (const auto& [first, last] : self.gaps_) gaps.insert(gaps.end(), {first, last});
    archive(gaps);
    if constexpr (Archive::kReads) {
      ledger.waiting = self.waiting_.size();
      self.gaps_.clear();
      if (!archive.Require(gaps.size() % 2 == 0, "gaps of a stream")) return;
      for (std::size_t i = 0; i < gaps.size(); i += 2) self.gaps_.emplace(gaps[i], gaps[i + 1]);
    }
  }
  // Whether what is received from here on becomes durable; without, durable_through stands still.
  void SetStored(bool stored);
  // The sample is on the disk, and so is what became of it.
  void Durable(std::uint64_t sequence);
  // The account was restored from the disk: everything in it is durable, and what comes next should be the number after
  // the last one (NextIs), because the client sends the rest again, in order.
  void Restored();
  [[nodiscard]] bool NextIs(std::uint64_t sequence) const;

  void Rename(const Ledger& names);
  // The next sample belongs to another session of the robot's client.
  void NewClient() { begun_ = false; }

  // Scans used or dropped so far, for deciding when to publish.
  [[nodiscard]] std::uint64_t settled_count() const { return settled_count_; }
  [[nodiscard]] Ledger ledger() const;

 private:
  static constexpr std::size_t kLatencies = 256;

  void Advance(std::uint64_t sequence);
  bool FillGap(std::uint64_t sequence);
  bool TakeBack(std::uint64_t sequence);
  void BeginAt(std::uint64_t sequence);
  void Settle(std::uint64_t sequence);
  void AdvanceDurable();

  Ledger ledger_;
  bool stored_ = false;
  bool begun_ = false;                // The client has sent a number before.
  std::uint64_t first_sequence_ = 0;  // The first number of the client; numbers missing before it are not lost.
  std::uint64_t settled_count_ = 0;
  std::set<std::uint64_t> waiting_;              // Numbers received and not settled; bounded by the robot's queue.
  std::set<std::uint64_t> undurable_;            // Numbers received and not yet on the disk, where stored.
  std::map<std::uint64_t, std::uint64_t> gaps_;  // First missing number -> last missing number, disjoint.
  std::array<float, kLatencies> latencies_ms_{};
  std::size_t latency_count_ = 0;
};

}  // namespace cairn::server
