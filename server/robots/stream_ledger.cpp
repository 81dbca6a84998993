#include "server/robots/stream_ledger.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "server/inbound.h"

namespace cairn::server {
namespace {

std::uint64_t& Count(Ledger& ledger, DropReason reason) {
  return ledger.dropped[static_cast<std::size_t>(reason)];
}

}  // namespace

bool StreamLedger::IsDoubtful(std::uint64_t sequence) {
  const std::uint64_t claimed = std::exchange(claimed_, 0);
  const auto follows = [sequence](std::uint64_t other) {
    return sequence <= other || sequence - other <= kBelievedStep;
  };
  if (!begun_ || follows(ledger_.last_sequence)) return false;
  if (claimed != 0 && claimed <= sequence && follows(claimed)) return false;
  claimed_ = sequence;
  return true;
}

bool StreamLedger::Received(std::uint64_t sequence) {
  if (sequence > 0) {
    const bool first = !std::exchange(begun_, true);
    if (first || (sequence > ledger_.last_sequence && sequence - ledger_.last_sequence > kMaxStep)) {
      BeginAt(sequence);
    } else if (sequence > ledger_.last_sequence) {
      Advance(sequence);
    } else if (!FillGap(sequence)) {
      return false;
    }
    waiting_.insert(sequence);
    if (stored_) undurable_.insert(sequence);
  }
  ++ledger_.received;
  ++ledger_.waiting;
  return true;
}

void StreamLedger::Used(std::uint64_t sequence, Stamp stamp, bool keyframe, double latency_ms) {
  ++ledger_.used;
  if (keyframe) ++ledger_.keyframes;
  ledger_.last_stamp = stamp;
  latencies_ms_[latency_count_++ % kLatencies] = static_cast<float>(latency_ms);
  Settle(sequence);
}

void StreamLedger::Used(std::uint64_t sequence, Stamp stamp) {
  ++ledger_.used;
  ledger_.last_stamp = stamp;
  Settle(sequence);
}

void StreamLedger::Dropped(std::uint64_t sequence, DropReason reason) {
  ++Count(ledger_, reason);
  Settle(sequence);
}

void StreamLedger::DroppedForeign(DropReason reason) {
  ++ledger_.received;
  ++Count(ledger_, reason);
  ++settled_count_;
}

void StreamLedger::SetStored(bool stored) {
  stored_ = stored;
  if (!stored) undurable_.clear();
}

void StreamLedger::BeginStoring(const std::set<std::uint64_t>& in_checkpoint) {
  stored_ = true;
  undurable_.clear();
  std::ranges::set_difference(waiting_, in_checkpoint, std::inserter(undurable_, undurable_.end()));
}

void StreamLedger::Durable(std::uint64_t sequence) {
  if (stored_ && undurable_.erase(sequence) > 0) AdvanceDurable();
}

void StreamLedger::Restored() {
  stored_ = true;
  undurable_.clear();
  AdvanceDurable();
}

bool StreamLedger::NextIs(std::uint64_t sequence) const {
  return sequence <= ledger_.last_sequence + 1;
}

void StreamLedger::NewClient() {
  begun_ = false;
  ledger_.last_sequence = ledger_.settled_through = ledger_.durable_through = 0;
  waiting_.clear();
  undurable_.clear();
  gaps_.clear();
}

bool StreamLedger::AreSound(const std::vector<std::uint64_t>& gaps) const {
  const std::uint64_t last = ledger_.last_sequence;
  if (last > kMaxSequence || ledger_.settled_through > last || gaps.size() % 2 != 0 || gaps.size() > 2 * kMaxGaps)
    return false;
  if (!waiting_.empty() && (*waiting_.begin() < 1 || *waiting_.rbegin() > last)) return false;
  std::uint64_t after = 0;  // Each gap lies behind the one before, and the last number is in none.
  for (std::size_t i = 0; i < gaps.size(); i += 2) {
    if (gaps[i] <= after || gaps[i + 1] < gaps[i] || gaps[i + 1] >= last) return false;
    after = gaps[i + 1];
  }
  return true;
}

void StreamLedger::AdvanceDurable() {
  std::uint64_t through = undurable_.empty() ? ledger_.last_sequence : *undurable_.begin() - 1;
  // A gap is stored only with a later number. Until that is on the disk, a server that starts again still expects the
  // missing numbers.
  for (auto after = gaps_.upper_bound(through); after != gaps_.begin(); after = gaps_.upper_bound(through)) {
    const auto& [first, last] = *std::prev(after);
    if (last < through) break;
    through = first - 1;
  }
  ledger_.durable_through = std::max(ledger_.durable_through, through);
}

void StreamLedger::Rename(const Ledger& names) {
  ledger_.robot_id = names.robot_id;
  ledger_.sensor_id = names.sensor_id;
  ledger_.robot = names.robot;
  ledger_.sensor = names.sensor;
  ledger_.site = names.site;
}

Ledger StreamLedger::ledger() const {
  Ledger now = ledger_;
  const std::size_t count = std::min(latency_count_, kLatencies);
  if (count == 0) return now;
  auto sorted = latencies_ms_;
  std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count));
  now.latency_p50_ms = sorted[(count - 1) / 2];
  now.latency_p99_ms = sorted[(count - 1) * 99 / 100];
  return now;
}

void StreamLedger::Advance(std::uint64_t sequence) {
  const std::uint64_t expected = ledger_.last_sequence + 1;
  if (sequence > expected) {
    gaps_.emplace(expected, sequence - 1);
    Count(ledger_, DropReason::kLostOnWire) += sequence - expected;
    ForgetOldGaps();
  }
  ledger_.last_sequence = sequence;
}

bool StreamLedger::FillGap(std::uint64_t sequence) {
  auto after = gaps_.upper_bound(sequence);
  if (after == gaps_.begin()) return false;
  const auto gap = std::prev(after);
  const auto [first, last] = *gap;
  if (sequence > last) return false;
  gaps_.erase(gap);
  if (first < sequence) gaps_.emplace(first, sequence - 1);
  if (sequence < last) gaps_.emplace(sequence + 1, last);
  ForgetOldGaps();
  if (sequence > first_sequence_) --Count(ledger_, DropReason::kLostOnWire);
  return true;
}

void StreamLedger::ForgetOldGaps() {
  while (gaps_.size() > kMaxGaps) gaps_.erase(gaps_.begin());
}

std::optional<StreamLedger> StreamLedger::AsJournaled(const std::set<std::uint64_t>& taken) const {
  // Samples without a number, or of an earlier client, wait as well.
  if (ledger_.waiting != waiting_.size() || !std::ranges::includes(waiting_, taken)) return std::nullopt;
  StreamLedger account = *this;
  for (auto number = waiting_.rbegin(); number != waiting_.rend(); ++number) {
    if (!taken.contains(*number) && !account.TakeBack(*number)) return std::nullopt;
  }
  return account;
}

// The reverse of Received. REQUIRES: the sample waits, and no later sample remains to be taken back.
bool StreamLedger::TakeBack(std::uint64_t sequence) {
  const bool leaves_gap = sequence < ledger_.last_sequence;
  if (sequence <= first_sequence_ || (leaves_gap && gaps_.size() >= kMaxGaps)) return false;
  --ledger_.received;
  --ledger_.waiting;
  waiting_.erase(sequence);
  if (leaves_gap) {
    gaps_.emplace(sequence, sequence);
    ++Count(ledger_, DropReason::kLostOnWire);
    return true;
  }
  --ledger_.last_sequence;
  if (!gaps_.empty() && gaps_.rbegin()->second == ledger_.last_sequence) {
    const auto [first, last] = *gaps_.rbegin();
    Count(ledger_, DropReason::kLostOnWire) -= last - first + 1;
    ledger_.last_sequence = first - 1;
    gaps_.erase(std::prev(gaps_.end()));
  }
  ledger_.settled_through = std::min(ledger_.settled_through, ledger_.last_sequence);
  return true;
}

void StreamLedger::BeginAt(std::uint64_t sequence) {
  gaps_.clear();
  if (sequence > 1) gaps_.emplace(1, sequence - 1);
  waiting_.clear();
  first_sequence_ = sequence;
  ledger_.last_sequence = sequence;
  ledger_.settled_through = sequence - 1;
  undurable_.clear();
  ledger_.durable_through = stored_ ? sequence - 1 : 0;
}

void StreamLedger::Settle(std::uint64_t sequence) {
  --ledger_.waiting;
  ++settled_count_;
  waiting_.erase(sequence);
  const std::uint64_t through = waiting_.empty() ? ledger_.last_sequence : *waiting_.begin() - 1;
  ledger_.settled_through = std::max(ledger_.settled_through, through);
}

}  // namespace cairn::server
