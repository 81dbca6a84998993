#include "common/wire/bus.h"

#include <numeric>

#include "common/wire/participant.h"
#include "common/wire/partitioned_publication.h"
#include "common/wire/publication.h"
#include "common/wire/subscription.h"

namespace cairn::wire {
namespace {

class DdsBus final : public Bus {
 public:
  explicit DdsBus(std::shared_ptr<Participant> participant) : participant_(std::move(participant)) {}
  [[nodiscard]] const std::shared_ptr<Participant>& participant() const { return participant_; }
  const WireOptions& options() const override { return participant_->options(); }
  std::uint64_t datagrams_refused() const override {
    const RefusedDatagrams& refused = participant_->guard().refused;
    return std::accumulate(refused.begin(), refused.end(), std::uint64_t{0});
  }
  std::uint64_t bytes_received() const override { return participant_->guard().bytes.load(std::memory_order_relaxed); }
  std::chrono::nanoseconds busy_with_one_datagram() const override {
    return participant_->guard().receiving.Longest(ReceiveWatch::Clock::now());
  }
  std::string refused_by_reason() const override {
    const RefusedDatagrams& refused = participant_->guard().refused;
    std::string text;
    for (std::size_t fault = 0; fault < refused.size(); ++fault) {
      if (refused[fault] == 0) continue;
      text += (text.empty() ? "" : ", ") + std::to_string(refused[fault]) + ' ';
      text += DatagramFaultName(static_cast<DatagramFault>(fault));
    }
    return text.empty() ? "none" : text;
  }
  Refusals refusals() const override {
    Refusals refusals = participant_->peers().refusals();
    refusals.datagrams = datagrams_refused();
    return refusals;
  }
  std::vector<std::string> TakeRefusalLines() override { return participant_->peers().TakeLines(); }

 private:
  const std::shared_ptr<Participant> participant_;
};

// The cast is safe because Create makes no other class.
const std::shared_ptr<Participant>& ParticipantOf(const Bus& bus) {
  return static_cast<const DdsBus&>(bus).participant();
}

}  // namespace

Result<std::unique_ptr<Bus>> Bus::Create(const WireOptions& options, const std::string& name) {
  Result<std::shared_ptr<Participant>> participant = Participant::Create(options, name);
  if (!participant) return tl::unexpected(participant.error());
  return std::make_unique<DdsBus>(std::move(*participant));
}

template <typename Value>
Result<std::unique_ptr<Publication<Value>>> Bus::Advertise(const std::string& robot) {
  constexpr Partitions kPartitions = Topic<Value>::kProfile.partitions;
  if constexpr (kPartitions == Partitions::kReplies || kPartitions == Partitions::kShares) {
    return PartitionedPublication<Value>::Make(ParticipantOf(*this));
  } else {
    return DdsPublication<Value>::Make(ParticipantOf(*this),
                                       robot.empty() ? std::vector<std::string>() : std::vector{robot});
  }
}

template <typename Value>
Result<std::unique_ptr<Subscription>> Bus::Subscribe(std::function<void(Value&&)> on_value, SubscriptionEvents events) {
  return DdsSubscription<Value>::Make(ParticipantOf(*this), std::move(on_value), std::move(events));
}

Result<std::unique_ptr<Subscription>> Bus::SubscribeReplies(ClientId client, std::function<void(Reply&&)> on_value,
                                                            SubscriptionEvents events) {
  return DdsSubscription<Reply>::Make(ParticipantOf(*this), std::move(on_value), std::move(events), client);
}

template <typename Value>
Result<std::unique_ptr<Subscription>> Bus::SubscribeRobot(NameId robot_id, std::function<void(Value&&)> on_value,
                                                          SubscriptionEvents events) {
  static_assert(Topic<Value>::kProfile.partitions == Partitions::kShares);
  return DdsSubscription<Value>::Make(ParticipantOf(*this), std::move(on_value), std::move(events), robot_id);
}
template Result<std::unique_ptr<Subscription>> Bus::SubscribeRobot(NameId, std::function<void(PoseReport&&)>,
                                                                   SubscriptionEvents);
template Result<std::unique_ptr<Subscription>> Bus::SubscribeRobot(NameId, std::function<void(Ledger&&)>,
                                                                   SubscriptionEvents);

// The macro's argument is a type and cannot be in parentheses. NOLINTBEGIN(bugprone-macro-parentheses)
#define CAIRN_WIRE_VALUE(Value)                                                                       \
  template Result<std::unique_ptr<Publication<Value>>> Bus::Advertise<Value>(const std::string&);     \
  template Result<std::unique_ptr<Subscription>> Bus::Subscribe<Value>(std::function<void(Value &&)>, \
                                                                       SubscriptionEvents)
// NOLINTEND(bugprone-macro-parentheses)
CAIRN_WIRE_VALUE(SessionRequest);
CAIRN_WIRE_VALUE(SessionState);
CAIRN_WIRE_VALUE(SessionRefusal);
CAIRN_WIRE_VALUE(ScanSample);
CAIRN_WIRE_VALUE(OdometrySample);
CAIRN_WIRE_VALUE(PoseReport);
CAIRN_WIRE_VALUE(Ledger);
CAIRN_WIRE_VALUE(MapInfo);
CAIRN_WIRE_VALUE(TileSample);
CAIRN_WIRE_VALUE(Job);
CAIRN_WIRE_VALUE(Request);
CAIRN_WIRE_VALUE(Command);
CAIRN_WIRE_VALUE(Reply);
#undef CAIRN_WIRE_VALUE

}  // namespace cairn::wire
