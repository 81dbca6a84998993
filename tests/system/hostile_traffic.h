// Datagrams that no honest participant sends, for a test and a study: forged RTPS submessages that name live
// participants, and mutations of recorded traffic, sent to every port of a DDS domain on loopback, also by multicast.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/mutex.h"

namespace cairn::test {

using Bytes = std::vector<std::uint8_t>;
using GuidPrefix = std::array<std::uint8_t, 12>;

// RTPS 9.6.1.1: discovery by multicast, and the two unicast ports of each of the first participants of a machine.
constexpr int kPortsOfDomain = 250;
[[nodiscard]] constexpr std::uint16_t FirstPort(std::int64_t domain) {
  return static_cast<std::uint16_t>(7400 + kPortsOfDomain * domain);
}
[[nodiscard]] std::vector<std::uint16_t> UnicastPorts(std::int64_t domain, int participants);

// A socket for sending to loopback. Thread-safe.
class Cannon {
 public:
  Cannon();
  ~Cannon();
  Cannon(const Cannon&) = delete;
  Cannon& operator=(const Cannon&) = delete;
  void Send(const Bytes& bytes, std::uint16_t port) const;
  // To all participants of the domain that listen for announcements.
  void SendToAll(const Bytes& bytes, std::int64_t domain) const;
  [[nodiscard]] std::uint16_t own_port() const { return own_port_; }

 private:
  void SendTo(const Bytes& bytes, std::uint32_t address, std::uint16_t port) const;

  int socket_ = -1;
  std::uint16_t own_port_ = 0;
};

// The GUID prefixes of the participants that announce themselves within `time`, by multicast on loopback.
[[nodiscard]] std::vector<GuidPrefix> OverhearParticipants(std::int64_t domain, std::chrono::milliseconds time);
// Whether the system lets this user record what others send (CAP_NET_RAW).
[[nodiscard]] bool MayRecord();
// All RTPS datagrams on loopback to ports of the domain within `time`, each once, but none that were sent from the port
// `except`.
[[nodiscard]] std::vector<Bytes> RecordDatagrams(std::int64_t domain, std::chrono::milliseconds time,
                                                 std::uint16_t except = 0);
// Of the senders of the datagrams.
[[nodiscard]] std::vector<GuidPrefix> PrefixesOf(const std::vector<Bytes>& datagrams);

// A HEARTBEAT by the entity of `from`, to all readers of the participant that gets it.
[[nodiscard]] Bytes ForgedHeartbeat(const GuidPrefix& from, std::uint32_t writer, std::int64_t first, std::int64_t last,
                                    std::uint32_t count);
// Bytes changed, removed and inserted; also numbers that the protocol gives a meaning.
[[nodiscard]] Bytes Mutated(Bytes bytes, std::mt19937& random);
// One to four submessages with fields that are plausible, extreme or random, from one of `prefixes`.
[[nodiscard]] Bytes Generated(const std::vector<GuidPrefix>& prefixes, std::mt19937& random);

// Sends mutated and generated datagrams from several threads, as fast as the system takes them. What it mutates is what
// the participants have sent lately, so that its numbers, names and secrets are those of now.
class HostileSenders {
 public:
  HostileSenders(std::int64_t domain, std::vector<Bytes> recorded, int senders, std::uint64_t seed);
  ~HostileSenders() { Stop(); }
  void Stop();
  [[nodiscard]] std::uint64_t sent() const { return sent_.load(std::memory_order_relaxed); }
  // How often it has recorded anew.
  [[nodiscard]] int recordings() const { return recordings_.load(std::memory_order_relaxed); }

 private:
  struct Traffic {
    explicit Traffic(std::vector<Bytes> recorded) : datagrams(std::move(recorded)), prefixes(PrefixesOf(datagrams)) {}
    std::vector<Bytes> datagrams;  // Never empty.
    std::vector<GuidPrefix> prefixes;
  };
  void Record();
  void Send(std::uint64_t seed);
  [[nodiscard]] std::shared_ptr<const Traffic> traffic() const {
    const MutexLock lock(mutex_);
    return traffic_;
  }

  const std::int64_t domain_;
  const std::vector<std::uint16_t> ports_;
  const Cannon cannon_;
  mutable Mutex mutex_;
  std::shared_ptr<const Traffic> traffic_ CAIRN_GUARDED_BY(mutex_);
  std::atomic<bool> stop_ = false;
  std::atomic<std::uint64_t> sent_ = 0;
  std::atomic<int> recordings_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace cairn::test
