#include "tests/system/hostile_traffic.h"

#include <arpa/inet.h>
#include <linux/filter.h>
#include <linux/if_packet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <set>

namespace cairn::test {
namespace {

constexpr std::size_t kRtpsHeader = 20;
constexpr char kGroup[] = "239.255.0.1";  // RTPS 9.6.1.4.1: where participants announce themselves.

bool IsRtps(const Bytes& bytes) {
  return bytes.size() >= kRtpsHeader && std::memcmp(bytes.data(), "RTPS", 4) == 0;
}

void Listen(int socket, std::chrono::milliseconds time, const auto& take) {
  const timeval patience{0, 50000};
  setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  const auto end = std::chrono::steady_clock::now() + time;
  Bytes buffer(70000);
  while (std::chrono::steady_clock::now() < end) {
    const ssize_t size = recv(socket, buffer.data(), buffer.size(), 0);
    if (size > 0) take(Bytes(buffer.begin(), buffer.begin() + size));
  }
}

void Put(Bytes& bytes, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}
void PutSequence(Bytes& bytes, std::int64_t value) {
  Put(bytes, static_cast<std::uint32_t>(static_cast<std::uint64_t>(value) >> 32));
  Put(bytes, static_cast<std::uint32_t>(value));
}
void PutEntity(Bytes& bytes, std::uint32_t entity) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<std::uint8_t>(entity >> shift));
}

Bytes HeaderOf(const GuidPrefix& from) {
  Bytes bytes = {'R', 'T', 'P', 'S', 2, 3, 1, 15};
  bytes.insert(bytes.end(), from.begin(), from.end());
  return bytes;
}

// The built-in entities, and the first ones that an application makes.
std::uint32_t SomeEntity(std::mt19937& random) {
  constexpr std::uint32_t kKnown[] = {0x000100c2, 0x000100c7, 0x000003c2, 0x000003c7, 0x000004c2,
                                      0x000004c7, 0x000200c2, 0x000200c7, 0};
  constexpr std::uint32_t kKinds[] = {0x02, 0x03, 0x04, 0x07};
  if (random() % 3 == 0) return kKnown[random() % std::size(kKnown)];
  return (random() % 16) << 8 | kKinds[random() % std::size(kKinds)];
}

std::int64_t SomeSequence(std::mt19937& random) {
  switch (random() % 8) {
    case 0:
      return static_cast<std::int64_t>(random()) << 31 | random();
    case 1:
      return -1;
    case 2:
      return std::int64_t{1} << (random() % 63);
    default:
      return random() % 3000;
  }
}

void PutSet(Bytes& bytes, std::mt19937& random) {
  const std::uint32_t bits = random() % 4 == 0 ? random() % 300 : random() % 40;
  Put(bytes, bits);
  for (std::uint32_t i = 0; i < (bits + 31) / 32; ++i) Put(bytes, static_cast<std::uint32_t>(random()));
}

std::uint32_t SomeCount(std::mt19937& random) {
  return static_cast<std::uint32_t>(random() % 4 == 0 ? random() : random() % 5000);
}

void PutNumbers(Bytes& bytes, std::uint8_t id, std::mt19937& random) {
  PutEntity(bytes, SomeEntity(random));
  PutEntity(bytes, SomeEntity(random));
  const std::int64_t base = SomeSequence(random);
  PutSequence(bytes, base);
  if (id == 0x07) PutSequence(bytes, random() % 2 == 0 ? base + random() % 3 - 1 : SomeSequence(random));
  if (id == 0x08) PutSequence(bytes, random() % 2 == 0 ? base + random() % 300 : SomeSequence(random));
  if (id == 0x12 || id == 0x13) Put(bytes, static_cast<std::uint32_t>(random() % 100));
  if (id != 0x07 && id != 0x13) PutSet(bytes, random);
  Put(bytes, SomeCount(random));
}

void PutSample(Bytes& bytes, std::uint8_t id, std::mt19937& random) {
  bytes.insert(bytes.end(), {0, 0, static_cast<std::uint8_t>(id == 0x15 ? 16 : 28), 0});
  PutEntity(bytes, SomeEntity(random));
  PutEntity(bytes, SomeEntity(random));
  PutSequence(bytes, SomeSequence(random));
  if (id == 0x16) {
    Put(bytes, static_cast<std::uint32_t>(random() % 10));
    Put(bytes, static_cast<std::uint32_t>(random() % 4 | (random() % 2000) << 16));
    Put(bytes, static_cast<std::uint32_t>(random() % 300000));
  }
  bytes.insert(bytes.end(), {0, static_cast<std::uint8_t>(random() % 4), 0, 0});
  for (unsigned i = 0, n = random() % 300; i < n; ++i) bytes.push_back(static_cast<std::uint8_t>(random() % 20));
}

}  // namespace

std::vector<std::uint16_t> UnicastPorts(std::int64_t domain, int participants) {
  std::vector<std::uint16_t> ports;
  for (int i = 0; i < 2 * participants; ++i) ports.push_back(static_cast<std::uint16_t>(FirstPort(domain) + 10 + i));
  return ports;
}

Cannon::Cannon() : socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  socklen_t size = sizeof(address);
  bind(socket_, reinterpret_cast<const sockaddr*>(&address), size);  // To a port that is free.
  getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size);
  own_port_ = ntohs(address.sin_port);
  in_addr loopback{};
  loopback.s_addr = htonl(INADDR_LOOPBACK);
  setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_IF, &loopback, sizeof(loopback));
}
Cannon::~Cannon() {
  close(socket_);
}

void Cannon::Send(const Bytes& bytes, std::uint16_t port) const {
  SendTo(bytes, htonl(INADDR_LOOPBACK), port);
}

void Cannon::SendToAll(const Bytes& bytes, std::int64_t domain) const {
  SendTo(bytes, inet_addr(kGroup), FirstPort(domain));
}

void Cannon::SendTo(const Bytes& bytes, std::uint32_t address, std::uint16_t port) const {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(port);
  to.sin_addr.s_addr = address;
  static_cast<void>(sendto(socket_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof(to)));
}

std::vector<GuidPrefix> PrefixesOf(const std::vector<Bytes>& datagrams) {
  std::set<GuidPrefix> prefixes;
  for (const Bytes& bytes : datagrams) {
    GuidPrefix prefix;
    std::copy_n(bytes.begin() + 8, prefix.size(), prefix.begin());
    prefixes.insert(prefix);
  }
  return {prefixes.begin(), prefixes.end()};
}

std::vector<GuidPrefix> OverhearParticipants(std::int64_t domain, std::chrono::milliseconds time) {
  const int listener = socket(AF_INET, SOCK_DGRAM, 0);
  const int on = 1;
  setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  setsockopt(listener, SOL_SOCKET, SO_REUSEPORT, &on, sizeof(on));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(FirstPort(domain));
  address.sin_addr.s_addr = inet_addr(kGroup);
  std::vector<Bytes> heard;
  ip_mreq group{};
  group.imr_multiaddr.s_addr = address.sin_addr.s_addr;
  group.imr_interface.s_addr = htonl(INADDR_LOOPBACK);
  if (bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 &&
      setsockopt(listener, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof(group)) == 0) {
    Listen(listener, time, [&](Bytes&& bytes) {
      if (IsRtps(bytes)) heard.push_back(std::move(bytes));
    });
  }
  close(listener);
  return PrefixesOf(heard);
}

bool MayRecord() {
  const int listener = socket(AF_PACKET, SOCK_RAW, 0);
  if (listener < 0) return errno != EPERM && errno != EACCES;
  close(listener);
  return true;
}

std::vector<Bytes> RecordDatagrams(std::int64_t domain, std::chrono::milliseconds time, std::uint16_t except) {
  constexpr std::uint16_t kIpv4 = 0x0800;
  constexpr std::size_t kEthernet = 14;
  constexpr std::uint8_t kUdp = 17;
  const int listener = socket(AF_PACKET, SOCK_RAW, 0);  // It receives nothing until it is bound.
  if (listener < 0) return {};
  // The kernel leaves them out: there may be a hundred thousand a second. The port stands first behind the IP header.
  sock_filter unless_from_port[] = {BPF_STMT(BPF_LDX | BPF_B | BPF_MSH, kEthernet),
                                    BPF_STMT(BPF_LD | BPF_H | BPF_IND, kEthernet),
                                    BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, except, 0, 1), BPF_STMT(BPF_RET | BPF_K, 0),
                                    BPF_STMT(BPF_RET | BPF_K, 0xffffffff)};
  const sock_fprog filter{.len = std::size(unless_from_port), .filter = unless_from_port};
  sockaddr_ll all{};
  all.sll_family = AF_PACKET;
  all.sll_protocol = htons(kIpv4);
  if (setsockopt(listener, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof(filter)) != 0 ||
      bind(listener, reinterpret_cast<const sockaddr*>(&all), sizeof(all)) != 0) {
    close(listener);
    return {};
  }
  std::set<Bytes> recorded;
  Listen(listener, time, [&](Bytes&& frame) {
    if (frame.size() < kEthernet + 28 || frame[kEthernet + 9] != kUdp) return;
    const std::size_t udp = kEthernet + 4 * (frame[kEthernet] & 0x0fU);
    const int port = frame[udp + 2] << 8 | frame[udp + 3];
    Bytes bytes(frame.begin() + static_cast<std::ptrdiff_t>(udp + 8), frame.end());
    if (port >= FirstPort(domain) && port < FirstPort(domain) + kPortsOfDomain && IsRtps(bytes))
      recorded.insert(std::move(bytes));
  });
  close(listener);
  return {recorded.begin(), recorded.end()};
}

Bytes ForgedHeartbeat(const GuidPrefix& from, std::uint32_t writer, std::int64_t first, std::int64_t last,
                      std::uint32_t count) {
  Bytes bytes = HeaderOf(from);
  bytes.insert(bytes.end(), {0x07, 0x01, 28, 0});
  PutEntity(bytes, 0);
  PutEntity(bytes, writer);
  PutSequence(bytes, first);
  PutSequence(bytes, last);
  Put(bytes, count);
  return bytes;
}

Bytes Mutated(Bytes bytes, std::mt19937& random) {
  constexpr std::uint32_t kWords[] = {0, 0xffffffff, 0x7fffffff, 0x80000000, 1};
  for (unsigned i = 0, n = 1 + random() % 8; i < n && bytes.size() > 24; ++i) {
    const std::size_t header = random() % 10 == 0 ? 0 : kRtpsHeader;
    // Most of what the protocol reads stands at the beginning.
    const std::size_t reach = random() % 2 == 0 ? std::min<std::size_t>(bytes.size(), 120) : bytes.size();
    const std::size_t at = header + random() % (reach - header);
    const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    switch (random() % 8) {
      case 0:
      case 1:
      case 2:
        bytes[at] = static_cast<std::uint8_t>(random());
        break;
      case 3:
        bytes[at] = static_cast<std::uint8_t>(bytes[at] + random() % 9 - 4);
        break;
      case 4:
      case 5:
        if (bytes.size() - at >= 4) std::memcpy(&bytes[at], &kWords[random() % std::size(kWords)], 4);
        break;
      case 6:
        bytes.erase(place,
                    place + static_cast<std::ptrdiff_t>(std::min<std::size_t>(1 + random() % 16, bytes.size() - at)));
        break;
      default:
        bytes.insert(place, 1 + random() % 8, static_cast<std::uint8_t>(random()));
    }
  }
  return bytes;
}

Bytes Generated(const std::vector<GuidPrefix>& prefixes, std::mt19937& random) {
  constexpr std::uint8_t kIds[] = {0x06, 0x07, 0x08, 0x12, 0x13, 0x15, 0x16};
  Bytes bytes = HeaderOf(prefixes[random() % prefixes.size()]);
  for (unsigned i = 0, n = 1 + random() % 4; i < n; ++i) {
    const std::uint8_t id = kIds[random() % std::size(kIds)];
    const std::uint8_t flags = id == 0x15 ? 0x05 : id == 0x16 ? 0x01 : static_cast<std::uint8_t>(1 | random() % 8);
    bytes.insert(bytes.end(), {id, flags, 0, 0});
    const std::size_t start = bytes.size();
    if (id == 0x15 || id == 0x16) {
      PutSample(bytes, id, random);
    } else {
      PutNumbers(bytes, id, random);
    }
    while ((bytes.size() - start) % 4 != 0) bytes.push_back(0);
    const std::size_t length = bytes.size() - start;
    bytes[start - 2] = static_cast<std::uint8_t>(length);
    bytes[start - 1] = static_cast<std::uint8_t>(length >> 8);
  }
  return bytes;
}

HostileSenders::HostileSenders(std::int64_t domain, std::vector<Bytes> recorded, int senders, std::uint64_t seed)
    : domain_(domain), ports_(UnicastPorts(domain, 8)), traffic_(std::make_shared<const Traffic>(std::move(recorded))) {
  threads_.emplace_back([this] { Record(); });
  for (int i = 0; i < senders; ++i)
    threads_.emplace_back([this, seed, i] { Send(seed + 1000 * static_cast<std::uint64_t>(i)); });
}

void HostileSenders::Stop() {
  stop_ = true;
  for (std::thread& thread : threads_) {
    if (thread.joinable()) thread.join();
  }
}

void HostileSenders::Record() {
  constexpr std::chrono::milliseconds kFor{500};
  while (!stop_) {
    auto recorded = RecordDatagrams(domain_, kFor, cannon_.own_port());
    if (recorded.empty()) continue;  // Nobody sends, because nobody receives.
    auto traffic = std::make_shared<const Traffic>(std::move(recorded));
    const MutexLock lock(mutex_);
    traffic_ = std::move(traffic);
    recordings_.fetch_add(1, std::memory_order_relaxed);
  }
}

void HostileSenders::Send(std::uint64_t seed) {
  constexpr int kWithTheSame = 1000;  // So many datagrams are made of one recording.
  std::mt19937 random(static_cast<std::mt19937::result_type>(seed));
  while (!stop_) {
    const auto lately = traffic();
    for (int i = 0; i < kWithTheSame && !stop_; ++i) {
      const Bytes bytes = random() % 3 == 0 ? Generated(lately->prefixes, random)
                                            : Mutated(lately->datagrams[random() % lately->datagrams.size()], random);
      const std::size_t port = random() % (ports_.size() + 1);
      if (port < ports_.size()) {
        cannon_.Send(bytes, ports_[port]);
      } else {
        cannon_.SendToAll(bytes, domain_);
      }
      sent_.fetch_add(1, std::memory_order_relaxed);
    }
  }
}

}  // namespace cairn::test
