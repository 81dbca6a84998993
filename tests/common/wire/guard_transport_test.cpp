#include "common/wire/guard_transport.h"

#include <fastdds/rtps/transport/ChainingTransport.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "tests/common/wire/datagram.h"

namespace cairn::wire {
namespace {

namespace transport = eprosima::fastdds::rtps;
namespace rtps = eprosima::fastrtps::rtps;

constexpr std::uint32_t kDiscovery = 7410, kDiscoveryMulticast = 7400, kTopics = 7411;

// Stands for a participant. It takes its time with each datagram and notes how many it had at once.
class SlowReceiver final : public transport::TransportReceiverInterface {
 public:
  void OnDataReceived(const rtps::octet*, std::uint32_t, const rtps::Locator_t&, const rtps::Locator_t&) override {
    const int at_once = ++inside_;
    int most = most_at_once;
    while (most < at_once && !most_at_once.compare_exchange_weak(most, at_once)) {
    }
    // As long as the other thread needs to come, if it may.
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::milliseconds(20);
    while (inside_ < 2 && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    --inside_;
    ++received;
  }

  std::atomic<int> most_at_once{0};
  std::atomic<int> received{0};

 private:
  std::atomic<int> inside_{0};
};

// What a participant has at once of datagrams that arrive at two of its ports.
int MostAtOnce(bool secure, std::array<std::uint32_t, 2> ports) {
  const auto descriptor = MakeGuardedUdp({"127.0.0.1"}, std::make_shared<GuardReport>(), secure);
  const std::unique_ptr<transport::TransportInterface> made(descriptor->create_transport());
  auto& guard = dynamic_cast<transport::ChainingTransport&>(*made);
  const std::vector<rtps::octet> datagram = test::Datagram().Heartbeat(1, 1).bytes();
  SlowReceiver receiver;
  std::vector<std::jthread> threads;
  for (const std::uint32_t port : ports) {
    threads.emplace_back([&, port] {
      const rtps::Locator_t local(LOCATOR_KIND_UDPv4, port), remote(LOCATOR_KIND_UDPv4, 50000);
      for (int i = 0; i < 10; ++i)
        guard.receive(&receiver, datagram.data(), static_cast<std::uint32_t>(datagram.size()), local, remote);
    });
  }
  threads.clear();
  EXPECT_EQ(receiver.received, 20);
  return receiver.most_at_once;
}

// Two threads removed the same peer, and handshakes stood still for ever.
TEST(GuardTransport, WithSecurityAParticipantHasOneMessageOfDiscoveryAtATime) {
  EXPECT_EQ(MostAtOnce(true, {kDiscovery, kDiscoveryMulticast}), 1);
}

TEST(GuardTransport, SamplesDoNotWaitForMessagesOfDiscovery) {
  EXPECT_EQ(MostAtOnce(true, {kDiscovery, kTopics}), 2);
  EXPECT_EQ(MostAtOnce(false, {kDiscovery, kDiscoveryMulticast}), 2);
}

}  // namespace
}  // namespace cairn::wire
