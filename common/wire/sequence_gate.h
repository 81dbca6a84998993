// Decides whether the numbers in RTPS submessages are plausible: a forged one that is far ahead makes a reader or a
// writer ignore everything up to it, so that nothing of the stream arrives until its numbers get there.
//
// The number of a peer's samples may grow by one from datagram to datagram without limit.
// It may skip numbers, because datagrams are lost and the first contact is late, but not more than kStep at once and
// kRate a second: no writer of Cairn makes so many samples, not even while the network is interrupted for hours. The
// first number of a peer may be any up to kMaxFirst. Fast DDS 2.9 counts from the number before to the new one, one by
// one, while its reader is locked, so a skip of more than kAtOnce is accepted only when the peer has repeated it for a
// while: a damaged or mutated datagram does not come again, and writers repeat their heartbeats.
// What a peer acknowledges is compared with what the participant itself has sent.
// This is no proof: a number that is a little too large passes. A stream that stands still because of one is noticed
// and made anew elsewhere (client/lib/robot_client.h).
// When its table is full, it forgets the peers that it has known for less than a second. Thread-safe.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <unordered_map>

#include "common/mutex.h"

namespace cairn::wire {

class SequenceGate {
 public:
  using Clock = std::chrono::steady_clock;
  // Whose numbers: a GUID, and what it numbers (four bytes).
  using Key = std::array<std::uint8_t, 20>;
  using GuidPrefix = std::array<std::uint8_t, 12>;
  using EntityId = std::uint32_t;  // As its four bytes stand in a datagram.

  static constexpr std::int64_t kStep = 512;
  static constexpr std::int64_t kRate = 5000;  // Per second.
  // Limit of a first number. A writer that has run for years stays far below it.
  static constexpr std::int64_t kMaxFirst = std::int64_t{1} << 40;
  static constexpr std::int64_t kAtOnce = 1'000'000;  // Fast DDS 2.9 counts them in less than 0.3 s.
  // A longer skip is accepted at this repetition, and not earlier than so long after the first time.
  static constexpr int kRepetitions = 4;
  static constexpr std::chrono::milliseconds kRepeatedFor{300};
  static constexpr std::size_t kMaxPeers = 16384;

  // Accepts and stores a number of a peer, or refuses it. Lower numbers than before are always accepted.
  [[nodiscard]] bool Accept(const Key& whose, std::int64_t number, Clock::time_point now);

  // Whether a number of a peer that is at least as high was accepted before.
  [[nodiscard]] bool Reached(const Key& whose, std::int64_t number) const;

  // The next number of what a peer sends and the participant wants counted. It is higher than any before, also if the
  // peer was forgotten meanwhile because there are too many.
  [[nodiscard]] std::uint32_t NextCount(const Key& whose);

  // The participant's own: its GUID prefix, and the highest number that each of its writers has sent.
  void Sent(const GuidPrefix& own, EntityId writer, std::int64_t number);
  // The highest number sent by one of its writers, 0 where it has sent nothing; nothing where `to` (all zero:
  // everybody) is another participant, or this one has not sent anything yet.
  [[nodiscard]] std::optional<std::int64_t> LastSent(const GuidPrefix& to, EntityId writer) const;

 private:
  struct Hash {
    std::size_t operator()(const Key& key) const;
  };
  struct Peer {
    std::int64_t highest = 0;
    bool accepted = false;  // Whether any number was; until then `highest` is 0.
    double skips = 0.0;     // How many numbers it may skip at `raised`.
    Clock::time_point first{};
    Clock::time_point raised{};
    // A long skip that is not accepted yet: where to, how often, since when.
    std::int64_t claimed = 0;
    int claims = 0;
    Clock::time_point claimed_first{};
  };
  [[nodiscard]] static bool IsRepeated(Peer& peer, std::int64_t number, Clock::time_point now);
  void MakeRoom() CAIRN_REQUIRES(mutex_);

  mutable Mutex mutex_;
  std::unordered_map<Key, Peer, Hash> peers_ CAIRN_GUARDED_BY(mutex_);
  std::unordered_map<Key, std::uint32_t, Hash> counts_ CAIRN_GUARDED_BY(mutex_);
  std::uint32_t highest_count_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::optional<GuidPrefix> own_ CAIRN_GUARDED_BY(mutex_);
  std::unordered_map<EntityId, std::int64_t> sent_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::wire
