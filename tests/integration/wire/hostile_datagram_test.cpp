// Garbage on the DDS ports of two participants that are busy with each other: both go on. Random bytes, random
// submessages, real discovery datagrams with bytes changed, cut and inserted, and the datagrams that abort a bare
// Fast DDS 2.9.1 (the assert on a statistics submessage that is not the last; found by fuzzing, idl/README.md).
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <atomic>
#include <random>
#include <thread>

#include "common/wire/bus.h"
#include "tests/common/wire/sample_values.h"
#include "tests/loopback.h"

namespace cairn::wire {
namespace {

using namespace test;

using Bytes = std::vector<std::uint8_t>;

constexpr char kDiscoveryGroup[] = "239.255.0.1";

// RTPS 9.6.1.1.
std::uint16_t DiscoveryPort() {
  return static_cast<std::uint16_t>(7400 + 250 * TestDomain());
}

Bytes KillerDatagram() {
  Bytes bytes = {'R', 'T', 'P', 'S', 2, 3, 1, 15};
  bytes.resize(20, 0x42);
  bytes.insert(bytes.end(), {0x80, 0x01, 56, 0});
  bytes.resize(80, 0);
  bytes.insert(bytes.end(), {0x01, 0x01, 0, 0});
  return bytes;
}

// The same, hidden: a receiver that goes on right after the seven bytes of the first submessage sees another one that
// ends with the datagram.
Bytes HiddenKillerDatagram() {
  Bytes bytes = {'R', 'T', 'P', 'S', 2, 3, 1, 15};
  bytes.resize(20, 0x42);
  bytes.insert(bytes.end(), {0x00, 0x01, 7, 0, 0, 0, 0, 0, 0, 0, 0, 0x22, 0x01, 0, 0, 0});
  bytes.insert(bytes.end(), {0x80, 0x01, 56, 0});
  bytes.resize(bytes.size() + 64, 0);
  return bytes;
}

void Append(Bytes& bytes, const Bytes& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

void Put(Bytes& bytes, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

// The inline parameters of a sample: its key, as a hash.
void PutKey(Bytes& bytes, std::uint32_t key) {
  Put(bytes, 0x10U << 16 | 0x70U);
  for (int i = 0; i < 4; ++i) Put(bytes, key);
  Put(bytes, 1);
}

void PutWriterAndSequence(Bytes& bytes, std::uint8_t writer, std::uint8_t kind, std::uint32_t sequence) {
  bytes.insert(bytes.end(), {0, 0, 0, 0, 0, 0, writer, kind, 0, 0, 0, 0});  // To every reader.
  Put(bytes, sequence);
}

// One of the two fragments of a sample.
Bytes Fragment(std::uint32_t number, std::uint8_t writer, std::uint8_t kind, std::uint32_t sequence) {
  Bytes bytes = {0x16, 0x03, 56, 1, 0, 0, 28, 0};  // DATA_FRAG of 312 bytes, little-endian, with parameters.
  PutWriterAndSequence(bytes, writer, kind, sequence);
  Put(bytes, number);
  Put(bytes, 256U << 16 | 1);  // One fragment of 256 bytes
  Put(bytes, 512);             // of a sample of 512.
  PutKey(bytes, sequence % 3);
  bytes.resize(bytes.size() + 256, 0);
  return bytes;
}

// There are no samples with the eight numbers from this one on.
Bytes Gap(std::uint8_t writer, std::uint8_t kind, std::uint32_t sequence) {
  Bytes bytes = {0x08, 0x01, 32, 0};
  PutWriterAndSequence(bytes, writer, kind, sequence);
  Put(bytes, 0);
  Put(bytes, sequence + 1);
  Put(bytes, 7);
  Put(bytes, 0xfe000000);
  return bytes;
}

// A whole sample that can not be decoded.
Bytes SampleOf(std::uint32_t key, std::uint8_t writer, std::uint32_t sequence) {
  Bytes bytes = {0x15, 0x07, 48, 0, 0, 0, 16, 0};
  PutWriterAndSequence(bytes, writer, 0x02, sequence);
  PutKey(bytes, key);
  bytes.insert(bytes.end(), {0, 1, 0, 0});
  return bytes;
}

class Attacker {
 public:
  Attacker() {
    socket_ = socket(AF_INET, SOCK_DGRAM, 0);
    in_addr loopback{htonl(INADDR_LOOPBACK)};
    setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_IF, &loopback, sizeof(loopback));
    // Participants announce themselves here: real datagrams to start from.
    listener_ = socket(AF_INET, SOCK_DGRAM, 0);
    const int on = 1;
    setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
    setsockopt(listener_, SOL_SOCKET, SO_REUSEPORT, &on, sizeof(on));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(DiscoveryPort());
    address.sin_addr.s_addr = inet_addr(kDiscoveryGroup);
    bound_ = bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    ip_mreq group{};
    group.imr_multiaddr.s_addr = inet_addr(kDiscoveryGroup);
    group.imr_interface = loopback;
    bound_ = bound_ && setsockopt(listener_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof(group)) == 0;
    const timeval patience{5, 0};
    setsockopt(listener_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  }
  ~Attacker() {
    close(socket_);
    close(listener_);
  }

  // Real announcements, as far as the network lets us listen.
  [[nodiscard]] std::vector<Bytes> Overhear(std::size_t count) const {
    std::vector<Bytes> heard;
    while (bound_ && heard.size() < count) {
      Bytes bytes(65536);
      const ssize_t size = recv(listener_, bytes.data(), bytes.size(), 0);
      if (size <= 0) break;
      bytes.resize(static_cast<std::size_t>(size));
      heard.push_back(bytes);
    }
    return heard;
  }

  // To the discovery group and to the four unicast ports of the first two participants.
  void SendEverywhere(const Bytes& bytes) const {
    Send(bytes, kDiscoveryGroup, DiscoveryPort());
    for (int offset = 10; offset < 14; ++offset) {
      Send(bytes, "127.0.0.1", static_cast<std::uint16_t>(DiscoveryPort() + offset));
    }
  }

 private:
  void Send(const Bytes& bytes, const char* host, std::uint16_t port) const {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = inet_addr(host);
    static_cast<void>(
        sendto(socket_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&address), sizeof(address)));
  }

  int socket_ = -1;
  int listener_ = -1;
  bool bound_ = false;
};

Bytes RandomBytes(std::mt19937& random) {
  Bytes bytes(random() % 1400);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

Bytes RandomSubmessages(std::mt19937& random) {
  constexpr std::uint8_t kIds[] = {0x01, 0x06, 0x07, 0x08, 0x09, 0x0c, 0x0d, 0x0e, 0x12, 0x13, 0x15, 0x16, 0x80};
  Bytes bytes = {'R', 'T', 'P', 'S', 2, 3, 1, 15};
  for (int i = 0; i < 12; ++i) bytes.push_back(static_cast<std::uint8_t>(random()));
  for (unsigned i = 0, n = 1 + random() % 4; i < n; ++i) {
    const auto length = static_cast<std::uint8_t>(random() % 80);
    bytes.insert(bytes.end(), {kIds[random() % std::size(kIds)], static_cast<std::uint8_t>(random()), length, 0});
    for (unsigned j = 0; j < length; ++j) bytes.push_back(static_cast<std::uint8_t>(random()));
  }
  return bytes;
}

Bytes Mutated(Bytes bytes, std::mt19937& random) {
  for (unsigned i = 0, n = 1 + random() % 8; i < n && bytes.size() > 24; ++i) {
    const std::size_t at = 20 + random() % (bytes.size() - 20);
    const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    switch (random() % 4) {
      case 0:
        bytes[at] = static_cast<std::uint8_t>(random());
        break;
      case 1:
        std::fill(place, std::min(place + 4, bytes.end()), random() % 2 ? std::uint8_t{0xff} : std::uint8_t{0});
        break;
      case 2:
        bytes.erase(place, std::min(place + 1 + random() % 16, bytes.end()));
        break;
      default:
        bytes.insert(place, 1 + random() % 8, static_cast<std::uint8_t>(random()));
    }
  }
  return bytes;
}

class HostileDatagrams : public ::testing::Test {
 protected:
  void SetUp() override {
    subscription_ = Must(receiver_->Subscribe<ScanSample>([this](ScanSample&&) { ++received_; }));
    publication_ = Must(sender_->Advertise<ScanSample>());
    ASSERT_TRUE(Eventually([&] { return publication_->matched() == 1 && subscription_->matched() == 1; }));
  }
  void ExpectDataStillFlows() {
    for (int i = 0; i < 50; ++i) {
      const int before = received_;
      ASSERT_TRUE(publication_->Publish(ExtremeScan(360)));
      ASSERT_TRUE(Eventually([&] { return received_ > before; }));
    }
  }

  // The greeting of a newcomer makes the others announce themselves; the headers of that say who sends.
  std::vector<Bytes> OverhearHeaders() {
    const auto visitor = MakeBus("visitor");
    std::vector<Bytes> headers = attacker_.Overhear(6);
    for (Bytes& bytes : headers) bytes.resize(20);
    std::ranges::sort(headers);
    headers.erase(std::unique(headers.begin(), headers.end()), headers.end());
    return headers;
  }
  void SendAs(Bytes bytes, const Bytes& submessages) const {
    Append(bytes, submessages);
    attacker_.SendEverywhere(bytes);
  }
  void ExpectANewRobotIsHeard() {
    const auto newcomer = MakeBus("newcomer");
    const auto publication = Must(newcomer->Advertise<ScanSample>());
    ASSERT_TRUE(Eventually([&] { return publication->matched() == 1; }));
    ScanSample scan = ExtremeScan(360);
    ++scan.stream.robot_id;
    const int before = received_;
    EXPECT_TRUE(Eventually([&] { return publication->Publish(scan) && received_ > before; }));
  }

  std::atomic<int> received_ = 0;
  const std::unique_ptr<Bus> sender_ = MakeBus("sender");
  const std::unique_ptr<Bus> receiver_ = MakeBus("receiver");
  std::unique_ptr<Publication<ScanSample>> publication_;
  std::unique_ptr<Subscription> subscription_;
  const Attacker attacker_;
};

TEST_F(HostileDatagrams, TheKillerOf84BytesIsKeptOut) {
  attacker_.SendEverywhere(KillerDatagram());
  attacker_.SendEverywhere(HiddenKillerDatagram());
  EXPECT_TRUE(Eventually([&] { return sender_->datagrams_refused() > 0 && receiver_->datagrams_refused() > 0; }));
  ExpectDataStillFlows();
}

// The library makes room for as many properties as an announcement's identity token says, also without security.
TEST_F(HostileDatagrams, AnIdentityTokenOfFourThousandMillionPropertiesIsKeptOut) {
  Bytes bytes = {'R', 'T', 'P', 'S', 2, 3, 1, 15, 1, 15, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  const Bytes announcement = {0x15, 0x05, 44, 0,                                         // DATA, little-endian
                              0,    0,    16, 0, 0,    1,    0,    0xc7, 0, 1, 0, 0xc2,  // for readers of participants
                              0,    0,    0,  0, 1,    0,    0,    0,                    // sequence number 1
                              0,    3,    0,  0,                                         // a parameter list:
                              0x01, 0x10, 12, 0,                                         // the identity token,
                              0,    0,    0,  0, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0,     // its class and properties
                              1,    0,    0,  0};                                        // the end
  bytes.insert(bytes.end(), announcement.begin(), announcement.end());
  attacker_.SendEverywhere(bytes);
  EXPECT_TRUE(Eventually([&] { return sender_->datagrams_refused() > 0 && receiver_->datagrams_refused() > 0; }));
  ExpectDataStillFlows();
}

// Fast DDS 2.9.1 keeps a pointer to a sample of which some fragments have arrived, also after a gap has taken the
// sample back. Then it delivers leftovers, or aborts.
TEST_F(HostileDatagrams, FragmentsThatAGapTakesBackLeaveNothingBehind) {
  ExpectDataStillFlows();
  const std::vector<Bytes> headers = OverhearHeaders();
  ASSERT_FALSE(headers.empty());
  for (std::uint32_t sequence = 200; sequence < 400; sequence += 8) {
    for (const Bytes& header : headers) {
      for (std::uint8_t writer = 1; writer <= 4; ++writer) {
        for (const std::uint8_t kind : {0x02, 0x03}) {
          for (std::uint32_t i = 0; i < 8; ++i) SendAs(header, Fragment(1, writer, kind, sequence + i));
          SendAs(header, Gap(writer, kind, sequence));
        }
      }
    }
  }
  ExpectDataStillFlows();
  ExpectANewRobotIsHeard();
}

// The same where the samples are whole in the end: the gap comes between their fragments, in one datagram with the last
// ones; or the first fragments would come alone, because the last ones are in a datagram with one of another sample.
TEST_F(HostileDatagrams, FragmentsThatArriveTogetherWithOthersLeaveNothingBehind) {
  ExpectDataStillFlows();
  const std::vector<Bytes> headers = OverhearHeaders();
  ASSERT_FALSE(headers.empty());
  for (std::uint32_t sequence = 200; sequence < 600; sequence += 8) {
    for (const Bytes& header : headers) {
      for (std::uint8_t writer = 1; writer <= 4; ++writer) {
        for (const std::uint8_t kind : {0x02, 0x03}) {
          Bytes last;
          for (std::uint32_t i = 0; i < 8; ++i) {
            SendAs(header, Fragment(1, writer, kind, sequence + i));
            Append(last, Fragment(2, writer, kind, sequence + i));
          }
          Bytes gap = Gap(writer, kind, sequence);
          if (sequence % 16 == 0) {
            Append(gap, last);
          } else {
            Append(last, Fragment(1, writer, kind, sequence + 500));
            SendAs(header, last);
          }
          SendAs(header, gap);
        }
      }
    }
  }
  ExpectDataStillFlows();
  ExpectANewRobotIsHeard();
}

// Fast DDS 2.9.1 keeps a place for the key of every sample, also of those that it has not delivered when their writer
// goes. When there are no more places, it refuses all keys that are new.
TEST_F(HostileDatagrams, KeysThatNobodyHasDoNotFillAReaderForEver) {
  ExpectDataStillFlows();
  const std::vector<Bytes> headers = OverhearHeaders();
  ASSERT_FALSE(headers.empty());
  const auto begin = std::chrono::steady_clock::now();
  constexpr std::uint32_t kKeys = 9000;  // The reader has 8192 places.
  for (std::uint32_t key = 0; key < kKeys; ++key) {
    for (const Bytes& header : headers)
      for (std::uint8_t writer = 1; writer <= 4; ++writer) SendAs(header, SampleOf(key, writer, 200 + key));
    // Not faster than the numbers of a writer may grow.
    std::this_thread::sleep_until(begin + std::chrono::microseconds(250) * key);
  }
  ExpectANewRobotIsHeard();
}

TEST_F(HostileDatagrams, RandomBytesAndSubmessagesAreSurvived) {
  std::mt19937 random(11);
  for (int i = 0; i < 3000; ++i) {
    attacker_.SendEverywhere(i % 2 ? RandomBytes(random) : RandomSubmessages(random));
    if (i % 100 == 0) ExpectDataStillFlows();
  }
  ExpectDataStillFlows();
  EXPECT_GT(sender_->datagrams_refused(), 0U);
}

TEST_F(HostileDatagrams, MutatedAnnouncementsAreSurvived) {
  const auto visitor = MakeBus("visitor");  // Its greeting is what is overheard.
  const std::vector<Bytes> heard = attacker_.Overhear(4);
  ASSERT_FALSE(heard.empty());
  std::mt19937 random(12);
  for (int i = 0; i < 3000; ++i) {
    attacker_.SendEverywhere(Mutated(heard[static_cast<std::size_t>(i) % heard.size()], random));
    if (i % 100 == 0) ExpectDataStillFlows();
  }
  ExpectDataStillFlows();
}

}  // namespace
}  // namespace cairn::wire
