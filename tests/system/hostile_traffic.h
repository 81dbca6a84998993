// Datagrams that no honest participant sends, for a test and a study: forged RTPS submessages that name live
// participants, and mutations of recorded traffic, sent to every port of a DDS domain on loopback.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <random>
#include <string>
#include <thread>
#include <vector>

namespace cairn::test {

using Bytes = std::vector<std::uint8_t>;
using GuidPrefix = std::array<std::uint8_t, 12>;

// RTPS 9.6.1.1: discovery by multicast, and the two unicast ports of each of the first participants of a machine.
constexpr int kPortsOfDomain = 250;
[[nodiscard]] constexpr std::uint16_t FirstPort(std::int64_t domain) {
  return static_cast<std::uint16_t>(7400 + kPortsOfDomain * domain);
}
[[nodiscard]] std::vector<std::uint16_t> UnicastPorts(std::int64_t domain, int participants);

// A socket for sending to loopback. Not thread-safe.
class Cannon {
 public:
  Cannon();
  ~Cannon();
  Cannon(const Cannon&) = delete;
  Cannon& operator=(const Cannon&) = delete;
  void Send(const Bytes& bytes, std::uint16_t port) const;

 private:
  int socket_ = -1;
};

// The GUID prefixes of the participants that announce themselves within `time`, by multicast on loopback.
[[nodiscard]] std::vector<GuidPrefix> OverhearParticipants(std::int64_t domain, std::chrono::milliseconds time);
// All RTPS datagrams on loopback to ports of the domain within `time`, each once. Empty where the system does not let
// this user listen (CAP_NET_RAW).
[[nodiscard]] std::vector<Bytes> RecordDatagrams(std::int64_t domain, std::chrono::milliseconds time);
// Of the senders of the datagrams.
[[nodiscard]] std::vector<GuidPrefix> PrefixesOf(const std::vector<Bytes>& datagrams);

// A HEARTBEAT by the entity of `from`, to all readers of the participant that gets it.
[[nodiscard]] Bytes ForgedHeartbeat(const GuidPrefix& from, std::uint32_t writer, std::int64_t first, std::int64_t last,
                                    std::uint32_t count);
// Bytes changed, removed and inserted; also numbers that the protocol gives a meaning.
[[nodiscard]] Bytes Mutated(Bytes bytes, std::mt19937& random);
// One to four submessages with fields that are plausible, extreme or random, from one of `prefixes`.
[[nodiscard]] Bytes Generated(const std::vector<GuidPrefix>& prefixes, std::mt19937& random);

// Sends mutated and generated datagrams from several threads, as fast as the system takes them.
class HostileSenders {
 public:
  HostileSenders(std::int64_t domain, std::vector<Bytes> recorded, int senders, std::uint64_t seed);
  ~HostileSenders() { Stop(); }
  void Stop();
  [[nodiscard]] std::uint64_t sent() const { return sent_.load(std::memory_order_relaxed); }

 private:
  void Send(std::uint64_t seed);

  const std::vector<Bytes> recorded_;
  const std::vector<GuidPrefix> prefixes_;
  const std::vector<std::uint16_t> ports_;
  std::atomic<bool> stop_ = false;
  std::atomic<std::uint64_t> sent_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace cairn::test
