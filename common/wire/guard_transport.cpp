#include "common/wire/guard_transport.h"

#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include <algorithm>
#include <fastdds/rtps/common/LocatorSelector.hpp>

#include "common/mutex.h"
#include "common/wire/fragment_assembly.h"

namespace cairn::wire {
namespace {

namespace transport = eprosima::fastdds::rtps;
namespace rtps = eprosima::fastrtps::rtps;
using Bytes = std::span<const rtps::octet>;

struct GuardDescriptor : transport::ChainingTransportDescriptor {
  GuardDescriptor(std::shared_ptr<transport::TransportDescriptorInterface> udp, std::shared_ptr<GuardReport> to,
                  bool with_security)
      : ChainingTransportDescriptor(std::move(udp)), report(std::move(to)), secure(with_security) {}
  transport::TransportInterface* create_transport() const override;

  std::shared_ptr<GuardReport> report;
  bool secure;
};

class GuardTransport : public transport::ChainingTransport {
 public:
  explicit GuardTransport(const GuardDescriptor& descriptor)
      : ChainingTransport(descriptor), descriptor_(descriptor), report_(descriptor.report) {}

  transport::TransportDescriptorInterface* get_configuration() override { return &descriptor_; }

  bool send(rtps::SenderResource* udp, const rtps::octet* bytes, std::uint32_t size, transport::LocatorsIterator* begin,
            transport::LocatorsIterator* end, const std::chrono::steady_clock::time_point& timeout) override {
    NoteSent({bytes, size}, gate_);
    const FragmentAssembly::Datagram asking = WithQuestions({bytes, size});
    if (asking.empty()) return udp->send(bytes, size, begin, end, timeout);
    return udp->send(asking.data(), static_cast<std::uint32_t>(asking.size()), begin, end, timeout);
  }

  // Samples of topics go to each reader's own address, and not by multicast where all readers have one. By itself, Fast
  // DDS sends what two readers may have to their common multicast address, and what one of them needs to its own. A
  // participant has a thread for each address, so the two overtake each other: Cyclone DDS then saw the heartbeat of an
  // answer before the answer, took the answer for one of the past, and the program that had asked waited in vain (1 of
  // 12 on a busy machine).
  void select_locators(rtps::LocatorSelector& selector) const override {
    auto& readers = selector.transport_starts();
    if (std::any_of(readers.begin(), readers.end(), IsOfDiscoveryOrHasNoAddress))
      return ChainingTransport::select_locators(selector);
    for (std::size_t i = 0; i < readers.size(); ++i) {
      rtps::LocatorSelectorEntry& reader = *readers[i];
      if (!reader.transport_should_process) continue;
      for (std::size_t j = 0; j < reader.unicast.size(); ++j) {
        // Readers of one participant share their address. It gets each datagram once.
        if (IsLocatorSupported(reader.unicast[j]) && !selector.is_selected(reader.unicast[j]))
          reader.state.unicast.push_back(j);
      }
      if (reader.state.unicast.size() > 0) selector.select(i);
    }
  }

  void receive(transport::TransportReceiverInterface* next, const rtps::octet* bytes, std::uint32_t size,
               const rtps::Locator_t& local, const rtps::Locator_t& remote) override {
    report_->bytes.fetch_add(size, std::memory_order_relaxed);
    const Bytes received = WithoutStatistics({bytes, size});
    if (!IsSound(received)) return;
    const auto deliver = [&](Bytes datagram) {
      const std::vector<rtps::octet> counted = WithOwnCounts(datagram, gate_);
      if (!counted.empty()) datagram = counted;
      if (descriptor_.secure && IsOfDiscovery(local)) return DeliverAlone(next, datagram, local, remote);
      Deliver(next, datagram, local, remote);
    };
    if (!HasFragments(received)) return deliver(received);
    if (descriptor_.secure) {
      // Each fragment is encrypted by itself, and a reader takes none of a stranger. What built-in endpoints receive
      // could be inspected only in part.
      if (HasBuiltInFragments(received)) return Refuse(DatagramFault::kFragment);
      return deliver(received);
    }
    for (const FragmentAssembly::Datagram& datagram : Assemble(received)) {
      // The beginning of a sample could be seen only in part before.
      if (IsSound(datagram)) deliver(datagram);
    }
  }

 private:
  // DDSI-RTPS 2.2, 9.6.1.1: what participants and endpoints tell of themselves arrives at ports with even numbers, and
  // samples of topics at those with odd ones. A participant has a thread for each of its ports.
  static bool IsOfDiscovery(const rtps::Locator_t& local) { return local.port % 2 == 0; }
  // The last byte of an entity id: DDSI-RTPS 2.2, 9.3.1.2.
  static bool IsOfDiscoveryOrHasNoAddress(const rtps::LocatorSelectorEntry* reader) {
    const bool is_of_discovery = (reader->remote_guid.entityId.value[3] & 0xc0) == 0xc0;
    return reader->transport_should_process && (is_of_discovery || reader->unicast.size() == 0);
  }

  void Deliver(transport::TransportReceiverInterface* next, Bytes datagram, const rtps::Locator_t& local,
               const rtps::Locator_t& remote) {
    const ReceiveWatch::Delivery delivery(report_->receiving);
    next->OnDataReceived(datagram.data(), static_cast<std::uint32_t>(datagram.size()), local, remote);
  }

  // What a participant does about its peers is not safe on two threads at once, where DDS Security is used: of ten
  // programs that joined again and again, one in seventy was never let in, and now and then a program that was already
  // a member crashed because two threads removed the same peer.
  void DeliverAlone(transport::TransportReceiverInterface* next, Bytes datagram, const rtps::Locator_t& local,
                    const rtps::Locator_t& remote) {
    const MutexLock lock(discovery_);
    Deliver(next, datagram, local, remote);
  }

  bool IsSound(Bytes datagram) {
    const DatagramFault fault = InspectDatagram(datagram, gate_);
    if (fault != DatagramFault::kNone) Refuse(fault);
    return fault == DatagramFault::kNone;
  }

  void Refuse(DatagramFault fault) {
    report_->refused[static_cast<std::size_t>(fault)].fetch_add(1, std::memory_order_relaxed);
  }
  std::vector<FragmentAssembly::Datagram> Assemble(Bytes datagram) {
    const MutexLock lock(mutex_);
    return assembly_.Take(datagram);
  }
  FragmentAssembly::Datagram WithQuestions(Bytes datagram) {
    const MutexLock lock(mutex_);
    return assembly_.WithQuestions(datagram);
  }

  GuardDescriptor descriptor_;
  std::shared_ptr<GuardReport> report_;
  SequenceGate gate_;
  Mutex discovery_;  // Held while a message of discovery is handled, where DDS Security is used.
  Mutex mutex_;
  FragmentAssembly assembly_ CAIRN_GUARDED_BY(mutex_);
};

transport::TransportInterface* GuardDescriptor::create_transport() const {
  return new GuardTransport(*this);  // Fast DDS takes ownership.
}

}  // namespace

std::shared_ptr<transport::TransportDescriptorInterface> MakeGuardedUdp(const std::vector<std::string>& interfaces,
                                                                        std::shared_ptr<GuardReport> report,
                                                                        bool secure) {
  // A burst of tiles or replies overflows a socket buffer of default size. The kernel limits this size if it
  // is too large.
  constexpr std::uint32_t kSocketBufferBytes = 4 * 1024 * 1024;
  auto udp = std::make_shared<transport::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = interfaces;
  udp->sendBufferSize = kSocketBufferBytes;
  udp->receiveBufferSize = kSocketBufferBytes;
  return std::make_shared<GuardDescriptor>(std::move(udp), std::move(report), secure);
}

}  // namespace cairn::wire
