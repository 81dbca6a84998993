// The part of RobotClient that joins the domain, notices that a session makes no progress although a server is there,
// and then joins the domain with a new participant. What a reader or a writer has recorded about its peer, true or
// forged, belongs to the pair of participants, so a new participant starts without it.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "client/lib/robot_client.h"

namespace cairn::client {
namespace {

constexpr std::chrono::milliseconds kStaleAfter{1800};  // Together with the watcher's period below 2 s.
constexpr std::chrono::seconds kLostServer{3};          // Longer than the lease of a server that has gone.
constexpr std::chrono::seconds kLongestHandshake{6};    // It usually takes 1 s.
constexpr std::chrono::milliseconds kReportDelay{700};  // Until the server's report of a stream follows its samples.
constexpr std::chrono::seconds kKeepRetired{3};         // If the server does not answer the new participant.
// Pauses between two renewals. They double, because the server may be silent for another reason. They stay short while
// the guard drops datagrams, because then each new participant may be stopped like the one before.
constexpr std::chrono::seconds kShortestPause{2};
constexpr std::chrono::seconds kLongestPause{60};
constexpr std::chrono::seconds kStuckAfter{1};  // A datagram takes microseconds.
constexpr std::chrono::milliseconds kResendPause{
    500};  // While stale: what was sent before the server was found is lost.

}  // namespace

Result<void> RobotClient::Advertise(Wire& wire) {
  const auto advertise = [this, &wire](auto& publication) -> Result<void> {
    using Value = typename std::remove_reference_t<decltype(*publication)>::ValueType;
    auto made = wire.bus->Advertise<Value>(robot_);
    if (!made) return tl::unexpected(made.error());
    publication = std::move(*made);
    return {};
  };
  if (auto made = advertise(wire.scans); !made) return made;
  if (auto made = advertise(wire.odometry); !made) return made;
  return advertise(wire.session);
}

// Only the values of the current wire count.
template <typename Value>
Result<void> RobotClient::SubscribeTo(Wire& wire, void (RobotClient::*on_value)(Value&&),
                                      wire::SubscriptionEvents events) {
  auto take = [this, on_value, number = wire.number](Value&& value) {
    if (current_ == number) (this->*on_value)(std::move(value));
  };
  constexpr bool kOfOneRobot = std::is_same_v<Value, PoseReport> || std::is_same_v<Value, Ledger>;
  Result<std::unique_ptr<wire::Subscription>> subscription = [&] {
    if constexpr (kOfOneRobot) {
      return wire.bus->SubscribeRobot<Value>(HashName(robot_), std::move(take), std::move(events));
    } else {
      return wire.bus->Subscribe<Value>(std::move(take), std::move(events));
    }
  }();
  if (!subscription) return tl::unexpected(subscription.error());
  wire.subscriptions.push_back(std::move(*subscription));
  return {};
}

Result<void> RobotClient::Subscribe(Wire& wire) {
  wire::SubscriptionEvents events;
  events.matched = [this, number = wire.number](int servers) {
    if (current_ == number) OnMatched(servers);
  };
  if (auto done = SubscribeTo(wire, &RobotClient::OnSession, std::move(events)); !done) return done;
  if (auto done = SubscribeTo(wire, &RobotClient::OnRefusal); !done) return done;
  if (auto done = SubscribeTo(wire, &RobotClient::OnLedger); !done) return done;
  return SubscribeTo(wire, &RobotClient::OnPose);
}

std::shared_ptr<RobotClient::Wire> RobotClient::CurrentWire() const {
  const MutexLock lock(mutex_);
  return wire_;
}

// Recorders read scans, too; only the server reads the session.
bool RobotClient::connected() const {
  return CurrentWire()->session->matched() > 0;
}

void RobotClient::Sent(NameId sensor_id, std::uint64_t number) {
  const auto now = Clock::now();
  if (now - std::exchange(sent_at_, now) > kReportDelay) sending_since_ = now;
  Stream& stream = streams_.find(sensor_id)->second;
  if (stream.sent <= stream.arrived) stream.moved = now;
  stream.sent = std::max(stream.sent, number);
}

void RobotClient::Arrived(Stream& stream, std::uint64_t through) {
  const bool news = std::exchange(stream.arrived, through) != through;
  if (std::exchange(stream.first, false) || !news) return;
  stream.moved = stream.advanced = Clock::now();
}

// Why the session makes no progress; empty if it does.
std::string RobotClient::Silence(Clock::time_point now) {
  const bool server = wire_->session->matched() > 0;
  if (server) connected_at_ = now;
  if (Answered() || !server) answered_at_ = now;
  if (over_ || reopening_ || state_->phase == SessionPhase::kEnded) return {};
  if (now - answered_at_ > kStaleAfter) return "the server does not answer the session's request";
  const bool hostile = wire_->bus->datagrams_refused() > refused_at_renewal_;
  // With DDS Security a handshake may get stuck, and the server may have lost this participant while this one has not
  // lost the server: then none is begun any more (Fast DDS 2.9). A new participant begins another one.
  const bool stuck = !wire_->bus->options().security.empty() && now - connected_at_ > kLongestHandshake;
  if (stuck || (hostile && now - connected_at_ > kLostServer)) return "no server is found";
  for (const auto& [sensor_id, stream] : streams_) {
    if (!Answered() || !server || stream.sent <= stream.arrived || now - stream.moved <= kStaleAfter) continue;
    return fmt::format("nothing that was sent has arrived at the server for {:.1f} s ({} of {} samples {})",
                       std::chrono::duration<double>(now - stream.moved).count(), stream.arrived, stream.sent,
                       sensor_id == HashName(kOdometrySensor) ? "of odometry" : "of scans");
  }
  // The server also calls a stream stale that is not sent, such as that of a lidar that is switched off.
  const auto waits = [now](const auto& entry) CAIRN_NO_THREAD_SAFETY_ANALYSIS {
    return entry.second.sent > entry.second.arrived && now - entry.second.moved > kReportDelay;
  };
  const bool sending = now - sent_at_ < kReportDelay && now - sending_since_ > kReportDelay;
  if (sending && state_->stale && now - called_stale_ > kReportDelay && std::ranges::any_of(streams_, waits))
    return "the server says that nothing arrives";
  return {};
}

// Whether every stream that had stopped makes progress again.
bool RobotClient::Moving() const {
  if (!Answered()) return false;
  const auto moves = [&](const auto& entry)
                         CAIRN_NO_THREAD_SAFETY_ANALYSIS { return entry.second.advanced > renewed_at_; };
  if (backlog_.unsent() > 0 && std::none_of(streams_.begin(), streams_.end(), moves)) return false;
  return std::all_of(streams_.begin(), streams_.end(), [&](const auto& entry) CAIRN_NO_THREAD_SAFETY_ANALYSIS {
    const Stream& stream = entry.second;
    return stream.sent <= stream.arrived || stream.advanced > renewed_at_;
  });
}

bool RobotClient::RenewalDue(Clock::time_point now) {
  const std::uint64_t refused = wire_->bus->datagrams_refused();
  const bool hostile = refused > refused_at_renewal_;
  const auto since = now - renewed_at_;
  if (since < (hostile ? kShortestPause : renewal_pause_)) return false;
  const bool long_ago = since > 2 * kLongestPause;
  renewal_pause_ = hostile || long_ago ? kShortestPause
                                       : std::clamp<Clock::duration>(2 * renewal_pause_, kShortestPause, kLongestPause);
  return true;
}

// Nothing that was received before counts any more, not even a generation: it may have been forged.
void RobotClient::StartOver(Clock::time_point now) {
  answered_ = false;
  generation_ = 0;
  answered_at_ = connected_at_ = renewed_at_ = now;
  refused_at_renewal_ = wire_->bus->datagrams_refused();
  sent_before_ = backlog_.size() - backlog_.unsent();
  backlog_.Rewind();
  for (auto& [sensor_id, stream] : streams_) {
    stream.sent = stream.arrived = 0;
    stream.moved = now;
    stream.first = true;
  }
}

// Called by the watcher again and again.
void RobotClient::Recover() {
  bool renew = false;
  {
    const MutexLock lock(mutex_);
    const auto now = Clock::now();
    std::string silence = Silence(now);
    if (!silence.empty()) {
      renew = RenewalDue(now);
      stale_ = std::move(silence);
      changed_.NotifyAll();
    } else if (!stale_.empty() && Moving()) {
      stale_.clear();
      changed_.NotifyAll();
    } else if (!stale_.empty() && Streaming() && backlog_.unsent() == 0 && now - sent_at_ > kResendPause) {
      sent_before_ = backlog_.size();
      backlog_.Rewind();
    }
  }
  if (renew) Renew();
  DropRetired();
}

// A new participant continues the session. If none can be made, the old one stays.
void RobotClient::Renew() {
  const std::shared_ptr<Wire> before = CurrentWire();
  auto bus = wire::Bus::Create(before->bus->options(), "robot");
  if (!bus) return;
  const auto wire = std::make_shared<Wire>();
  wire->own = std::move(*bus);
  wire->bus = wire->own.get();
  wire->number = before->number + 1;
  if (!Advertise(*wire)) return;
  current_ = wire->number;
  if (!Subscribe(*wire)) {
    current_ = before->number;
    return;
  }
  {
    const MutexLock sending(sending_);
    const MutexLock lock(mutex_);
    wire_ = wire;
    StartOver(Clock::now());
  }
  retired_.push_back(before);
  renewed_.fetch_add(1, std::memory_order_relaxed);
  Ask();
}

// The old participants leave when the server knows the new one, so that it does not conclude that the robot has left.
void RobotClient::DropRetired() {
  if (retired_.empty()) return;
  {
    const MutexLock lock(mutex_);
    if (!Answered() && Clock::now() - renewed_at_ < kKeepRetired) return;
  }
  // Another thread may still be sending with it. A participant that is stuck in one datagram could not leave: this
  // thread would wait for it, and recover nothing any more.
  std::erase_if(retired_, [](const auto& wire) {
    return wire.use_count() == 1 && wire->bus->busy_with_one_datagram() < kStuckAfter;
  });
}

}  // namespace cairn::client
