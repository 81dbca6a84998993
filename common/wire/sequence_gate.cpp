#include "common/wire/sequence_gate.h"

#include <algorithm>
#include <functional>
#include <string_view>

namespace cairn::wire {

std::size_t SequenceGate::Hash::operator()(const Key& key) const {
  return std::hash<std::string_view>()({reinterpret_cast<const char*>(key.data()), key.size()});
}

bool SequenceGate::Accept(const Key& whose, std::int64_t number, Clock::time_point now) {
  if (number < 0) return false;
  const MutexLock lock(mutex_);
  auto known = peers_.find(whose);
  if (known == peers_.end()) {
    if (number > kMaxFirst) return false;
    if (peers_.size() >= kMaxPeers) MakeRoom();
    known = peers_.emplace(whose, Peer{.first = now, .raised = now}).first;
  }
  Peer& peer = known->second;
  if (peer.accepted && number <= peer.highest) return true;
  const double silent_s = std::chrono::duration<double>(now - peer.raised).count();
  const double allowed =
      peer.accepted ? peer.skips + static_cast<double>(kRate) * silent_s : static_cast<double>(kMaxFirst);
  const std::int64_t skipped = number - peer.highest - 1;
  if (static_cast<double>(skipped) > allowed) return false;
  if (skipped > kAtOnce && !IsRepeated(peer, number, now)) return false;
  peer.highest = number;
  peer.accepted = true;
  peer.skips = std::min(allowed - static_cast<double>(skipped), static_cast<double>(kStep));
  peer.raised = now;
  return true;
}

bool SequenceGate::Reached(const Key& whose, std::int64_t number) const {
  const MutexLock lock(mutex_);
  const auto known = peers_.find(whose);
  return known != peers_.end() && known->second.accepted && number <= known->second.highest;
}

bool SequenceGate::IsRepeated(Peer& peer, std::int64_t number, Clock::time_point now) {
  if (peer.claims == 0 || number > peer.claimed + kStep || number < peer.claimed - kStep) {
    peer.claims = 0;
    peer.claimed_first = now;
  }
  peer.claimed = number;
  return ++peer.claims >= kRepetitions && now - peer.claimed_first >= kRepeatedFor;
}

// Peers with invented identifiers are seen once. Those that are known for longer stay.
void SequenceGate::MakeRoom() {
  constexpr std::chrono::seconds kKnown{1};
  std::erase_if(peers_, [&](const auto& entry) { return entry.second.raised - entry.second.first < kKnown; });
  if (peers_.size() >= kMaxPeers) peers_.clear();
}

std::uint32_t SequenceGate::NextCount(const Key& whose) {
  const MutexLock lock(mutex_);
  if (counts_.size() >= kMaxPeers && !counts_.contains(whose)) counts_.clear();
  std::uint32_t& count = counts_.try_emplace(whose, highest_count_).first->second;
  highest_count_ = std::max(highest_count_, ++count);
  return count;
}

void SequenceGate::Sent(const GuidPrefix& own, EntityId writer, std::int64_t number) {
  const MutexLock lock(mutex_);
  own_ = own;
  std::int64_t& highest = sent_[writer];
  highest = std::max(highest, number);
}

std::optional<std::int64_t> SequenceGate::LastSent(const GuidPrefix& to, EntityId writer) const {
  const MutexLock lock(mutex_);
  if (!own_ || (to != *own_ && to != GuidPrefix{})) return std::nullopt;
  const auto known = sent_.find(writer);
  return known == sent_.end() ? 0 : known->second;
}

}  // namespace cairn::wire
