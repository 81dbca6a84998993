// Counts what happened to every sample (scan or odometry) of one stream (robot, sensor). `received + lost_on_wire` =
// `used + dropped + waiting` at every moment.
//
// Numbers: samples carry sequences from 1. A gap counts as lost_on_wire and settles at once, so that a
// client's window never waits for it. If a missing sample arrives late, it no longer counts as lost. A number seen
// before (a resend of something already received) is ignored and counted nowhere. At most kMaxGaps separate gaps are
// remembered; older ones stay lost for good. Numbers before the first one of a client may have gone to an earlier
// session or to the server before its last restart. They do not count as lost, and are taken if they come late. The
// counts go on. A number more than kMaxStep ahead begins a new count in the same way, because no client loses a million
// scans at once.
// A number that is more than kBelievedStep ahead is believed when another one follows it (IsDoubtful): a single forged
// or damaged sample would otherwise settle everything up to it, and the client would send none of this again.
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
  static constexpr std::uint64_t kBelievedStep = 256;  // A writer keeps no more samples: so many can be lost at once.

  explicit StreamLedger(Ledger names) : ledger_(std::move(names)) {}

  // Whether the sample must not be taken yet. Called with each number in the order of arrival, before Received.
  [[nodiscard]] bool IsDoubtful(std::uint64_t sequence);
  // A sample arrived. REQUIRES: at most kMaxSequence (inbound.h). Returns false for a duplicate number, which the
  // caller must ignore. Otherwise Used or Dropped must follow.
  bool Received(std::uint64_t sequence);
  void Used(std::uint64_t sequence, Stamp stamp, bool keyframe, double latency_ms);
  // The same for odometry, whose latency is not measured.
  void Used(std::uint64_t sequence, Stamp stamp);
  void Dropped(std::uint64_t sequence, DropReason reason);
  // A sample that another client sent under this stream's name. It is counted; its number is ignored.
  void DroppedForeign(DropReason reason);

  // The ledger as a checkpoint must contain it, which has to agree with the journal. Of the numbers that wait only
  // those in `journaled` are in the journal. The others are removed, as if they had never arrived, because later
  // entries of the journal or the client bring them again. Nothing if this is not possible exactly; the caller tries
  // again later.
  [[nodiscard]] std::optional<StreamLedger> AsJournaled(const std::set<std::uint64_t>& journaled) const;
  [[nodiscard]] const std::set<std::uint64_t>& waiting() const { return waiting_; }
  // For checkpoints (slam/state/archive.h). Names, latencies and durability are not part of a checkpoint.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    auto& ledger = self.ledger_;
    archive(ledger.received, ledger.used, ledger.keyframes, ledger.dropped, ledger.last_sequence,
            ledger.settled_through, ledger.last_stamp, self.begun_, self.first_sequence_, self.settled_count_,
            self.waiting_);
    std::vector<std::uint64_t> gaps;  // First and last missing number of each gap.
    for (const auto& [first, last] : self.gaps_) gaps.insert(gaps.end(), {first, last});
    archive(gaps);
    if constexpr (Archive::kReads) {
      ledger.waiting = self.waiting_.size();
      self.gaps_.clear();
      if (!archive.RequireThat([&] { return self.AreSound(gaps); }, "numbers of a stream")) return;
      for (std::size_t i = 0; i < gaps.size(); i += 2) self.gaps_.emplace(gaps[i], gaps[i + 1]);
    }
  }
  // Whether samples that are received from now on are stored. If not, durable_through stays where it is.
  void SetStored(bool stored);
  // Samples are stored again from now on, of those that wait all but these; a checkpoint that is being made holds
  // everything else. durable_through advances with StoredAgain, when that is on the disk.
  void BeginStoring(const std::set<std::uint64_t>& in_checkpoint);
  void StoredAgain() { AdvanceDurable(); }
  // The sample, and whether it was used or dropped, is on the disk.
  void Durable(std::uint64_t sequence);
  // The ledger was restored from the disk, so everything in it is durable. The next sample should have the number after
  // the last one (NextIs), because the client sends all later samples again, in order.
  void Restored();
  [[nodiscard]] bool NextIs(std::uint64_t sequence) const;

  void Rename(const Ledger& names);
  // The next number belongs to another client, which counts for itself: nothing of what it sends has arrived yet.
  // Samples of the earlier client that still wait are from now on Used or Dropped with the number 0.
  void NewClient();

  // Scans used or dropped so far, for deciding when to publish.
  [[nodiscard]] std::uint64_t settled_count() const { return settled_count_; }
  [[nodiscard]] Ledger ledger() const;

 private:
  static constexpr std::size_t kLatencies = 256;

  // Whether the numbers that were read can be those of a stream. Members looks at them, because a checkpoint may come
  // from a file: gaps without end would be walked through for ever, and numbers that never came would count as durable.
  [[nodiscard]] bool AreSound(const std::vector<std::uint64_t>& gaps) const;
  void Advance(std::uint64_t sequence);
  bool FillGap(std::uint64_t sequence);
  void ForgetOldGaps();
  bool TakeBack(std::uint64_t sequence);
  void BeginAt(std::uint64_t sequence);
  void Settle(std::uint64_t sequence);
  void AdvanceDurable();

  Ledger ledger_;
  bool stored_ = false;
  bool begun_ = false;                // The client has sent a number before.
  std::uint64_t first_sequence_ = 0;  // The first number of the client; numbers missing before it are not lost.
  std::uint64_t settled_count_ = 0;
  std::uint64_t claimed_ = 0;                    // The last number, if it was doubtful.
  std::set<std::uint64_t> waiting_;              // Numbers received and not settled; bounded by the robot's queue.
  std::set<std::uint64_t> undurable_;            // Numbers received and not yet on the disk.
  std::map<std::uint64_t, std::uint64_t> gaps_;  // First missing number -> last missing number, disjoint.
  std::array<float, kLatencies> latencies_ms_{};
  std::size_t latency_count_ = 0;
};

}  // namespace cairn::server
