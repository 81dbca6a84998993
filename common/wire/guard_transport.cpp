#include "common/wire/guard_transport.h"

#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include "common/mutex.h"
#include "common/wire/fragment_hold.h"

namespace cairn::wire {
namespace {

namespace transport = eprosima::fastdds::rtps;
namespace rtps = eprosima::fastrtps::rtps;

struct GuardDescriptor : transport::ChainingTransportDescriptor {
  GuardDescriptor(std::shared_ptr<transport::TransportDescriptorInterface> udp,
                  std::shared_ptr<RefusedDatagrams> counter)
      : ChainingTransportDescriptor(std::move(udp)), refused(std::move(counter)) {}
  transport::TransportInterface* create_transport() const override;

  std::shared_ptr<RefusedDatagrams> refused;
};

class GuardTransport : public transport::ChainingTransport {
 public:
  explicit GuardTransport(const GuardDescriptor& descriptor)
      : ChainingTransport(descriptor), descriptor_(descriptor), refused_(descriptor.refused) {}

  transport::TransportDescriptorInterface* get_configuration() override { return &descriptor_; }

  bool send(rtps::SenderResource* udp, const rtps::octet* bytes, std::uint32_t size, transport::LocatorsIterator* begin,
            transport::LocatorsIterator* end, const std::chrono::steady_clock::time_point& timeout) override {
    NoteSent({bytes, size}, gate_);
    return udp->send(bytes, size, begin, end, timeout);
  }

  void receive(transport::TransportReceiverInterface* next, const rtps::octet* bytes, std::uint32_t size,
               const rtps::Locator_t& local, const rtps::Locator_t& remote) override {
    const DatagramFault fault = InspectDatagram({bytes, size}, gate_);
    if (fault != DatagramFault::kNone) {
      (*refused_)[static_cast<std::size_t>(fault)].fetch_add(1, std::memory_order_relaxed);
      return;
    }
    const FragmentTraffic traffic = FragmentTrafficOf({bytes, size});
    if (traffic.fragments.empty() && !traffic.gap) return next->OnDataReceived(bytes, size, local, remote);
    // No gap of another thread may come between the fragments of a sample.
    const MutexLock lock(whole_samples_);
    if (traffic.fragments.empty()) return next->OnDataReceived(bytes, size, local, remote);
    for (const FragmentHold::Datagram& whole : hold_.Add({bytes, size}, traffic.fragments))
      next->OnDataReceived(whole.data(), static_cast<std::uint32_t>(whole.size()), local, remote);
  }

 private:
  GuardDescriptor descriptor_;
  std::shared_ptr<RefusedDatagrams> refused_;
  SequenceGate gate_;
  Mutex whole_samples_;
  FragmentHold hold_ CAIRN_GUARDED_BY(whole_samples_);
};

transport::TransportInterface* GuardDescriptor::create_transport() const {
  return new GuardTransport(*this);  // Fast DDS takes ownership.
}

}  // namespace

std::shared_ptr<transport::TransportDescriptorInterface> MakeGuardedUdp(const std::vector<std::string>& interfaces,
                                                                        std::shared_ptr<RefusedDatagrams> refused) {
  // A burst of tiles or replies overflows a socket buffer of default size. The kernel limits this size if it
  // is too large.
  constexpr std::uint32_t kSocketBufferBytes = 4 * 1024 * 1024;
  auto udp = std::make_shared<transport::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = interfaces;
  udp->sendBufferSize = kSocketBufferBytes;
  udp->receiveBufferSize = kSocketBufferBytes;
  return std::make_shared<GuardDescriptor>(std::move(udp), std::move(refused));
}

}  // namespace cairn::wire
