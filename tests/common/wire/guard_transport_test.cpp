#include "common/wire/guard_transport.h"

#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastrtps/utils/IPLocator.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <fastdds/rtps/common/LocatorSelector.hpp>
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

// A reader that announces an address of its own and one that it shares with all.
rtps::LocatorSelectorEntry ReaderAt(std::uint32_t port, const rtps::EntityId_t& id) {
  rtps::LocatorSelectorEntry reader(1, 1);
  reader.remote_guid.guidPrefix.value[0] = static_cast<rtps::octet>(port);
  reader.remote_guid.entityId = id;
  rtps::Locator_t own(LOCATOR_KIND_UDPv4, port), shared(LOCATOR_KIND_UDPv4, 7401);
  rtps::IPLocator::setIPv4(own, "127.0.0.1");
  rtps::IPLocator::setIPv4(shared, "239.255.0.1");
  reader.unicast.push_back(own);
  reader.multicast.push_back(shared);
  return reader;
}

// The ports to which one datagram for both readers goes.
std::vector<std::uint32_t> PortsFor(rtps::LocatorSelectorEntry one, rtps::LocatorSelectorEntry other) {
  const auto descriptor = MakeGuardedUdp({"127.0.0.1"}, std::make_shared<GuardReport>(), false);
  const std::unique_ptr<transport::TransportInterface> guard(descriptor->create_transport());
  rtps::LocatorSelector selector(eprosima::fastrtps::ResourceLimitedContainerConfig{});
  selector.add_entry(&one);
  selector.add_entry(&other);
  selector.reset(true);
  selector.selection_start();
  guard->select_locators(selector);
  std::vector<std::uint32_t> ports;
  selector.for_each([&ports](const rtps::Locator_t& locator) { ports.push_back(locator.port); });
  return ports;
}

// By multicast an answer came too late: after its own heartbeat, and Cyclone DDS did not take it.
TEST(GuardTransport, SamplesGoToEachReadersOwnAddressAndOnlyOnce) {
  const rtps::EntityId_t of_topic(0x104);
  EXPECT_EQ(PortsFor(ReaderAt(7411, of_topic), ReaderAt(7413, of_topic)), (std::vector<std::uint32_t>{7411, 7413}));
  EXPECT_EQ(PortsFor(ReaderAt(7411, of_topic), ReaderAt(7411, of_topic)), (std::vector<std::uint32_t>{7411}));
  rtps::LocatorSelectorEntry only_multicast = ReaderAt(7413, of_topic);
  only_multicast.unicast.clear();
  EXPECT_EQ(PortsFor(ReaderAt(7411, of_topic), only_multicast), (std::vector<std::uint32_t>{7401}));
}

TEST(GuardTransport, DiscoveryStillUsesMulticast) {
  EXPECT_EQ(PortsFor(ReaderAt(7410, rtps::c_EntityId_SEDPPubReader), ReaderAt(7412, rtps::c_EntityId_SEDPPubReader)),
            (std::vector<std::uint32_t>{7401}));
}

}  // namespace
}  // namespace cairn::wire
