#include "server/inbound.h"

#include <algorithm>
#include <utility>

namespace cairn::server {
namespace {

// Whose sample it is; nothing for other values.
std::optional<NameId> RobotOf(const InboundValue& value) {
  if (const auto* const scan = std::get_if<ScanArrival>(&value)) return scan->stream.robot_id;
  if (const auto* const odometry = std::get_if<OdometryArrival>(&value)) return odometry->stream.robot_id;
  return std::nullopt;
}

}  // namespace

bool Inbound::TryPush(InboundValue&& value) {
  const MutexLock lock(mutex_);
  return PushLocked(value);
}

bool Inbound::Push(InboundValue value) {
  const MutexLock lock(mutex_);
  while (!closed_) {
    if (PushLocked(value)) return true;
    room_.Wait(mutex_);
  }
  return false;
}

bool Inbound::PushLocked(InboundValue& value) {
  if (closed_) return false;
  Lane& lane = LaneOf(value);
  if (const auto* const news = std::get_if<ClientLiveliness>(&value)) {
    ForgetOlder(*news);
  } else if (lane.size() >= (&lane == &control_ ? kMaxControl : capacity_) || !HasShare(value)) {
    return false;
  }
  if (const auto robot = RobotOf(value)) ++in_streams_[*robot];
  lane.push_back({next_++, std::move(value)});
  filled_.NotifyOne();
  return true;
}

Inbound::Lane& Inbound::LaneOf(const InboundValue& value) {
  if (std::holds_alternative<Request>(value)) return questions_;
  if (std::holds_alternative<ScanArrival>(value) || std::holds_alternative<OdometryArrival>(value)) return streams_;
  return control_;
}

bool Inbound::HasShare(const InboundValue& value) const {
  const auto robot = RobotOf(value);
  const auto waiting = robot ? in_streams_.find(*robot) : in_streams_.end();
  return waiting == in_streams_.end() || waiting->second < std::max(capacity_ / 4, kLeastShare);
}

void Inbound::ForgetOlder(const ClientLiveliness& news) {
  const auto older = std::find_if(control_.begin(), control_.end(), [&news](const Arrived& waiting) {
    const auto* const liveliness = std::get_if<ClientLiveliness>(&waiting.value);
    return liveliness != nullptr && liveliness->client == news.client && liveliness->robot_id == news.robot_id;
  });
  if (older != control_.end()) control_.erase(older);
}

std::optional<InboundValue> Inbound::Pop(const std::stop_token& stop) {
  // Under the mutex, so that a stop cannot slip in between the check and the wait.
  const std::stop_callback wake(stop, [this] {
    const MutexLock lock(mutex_);
    filled_.NotifyAll();
  });
  const MutexLock lock(mutex_);
  for (;;) {
    if (stop.stop_requested()) return std::nullopt;
    if (auto value = PopLocked()) return value;
    if (closed_) return std::nullopt;
    filled_.Wait(mutex_);
  }
}

std::optional<InboundValue> Inbound::PopLocked() {
  Lane* first = nullptr;
  for (Lane* const lane : {&control_, &questions_, &streams_}) {
    if (!lane->empty() && (first == nullptr || lane->front().number < first->front().number)) first = lane;
  }
  if (first == nullptr) return std::nullopt;
  std::optional<InboundValue> value(std::move(first->front().value));
  first->pop_front();
  if (const auto robot = RobotOf(*value)) {
    const auto waiting = in_streams_.find(*robot);
    if (--waiting->second == 0) in_streams_.erase(waiting);
  }
  ++taken_;
  room_.NotifyAll();
  return value;
}

void Inbound::Close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  filled_.NotifyAll();
  room_.NotifyAll();
}

std::size_t Inbound::size() const {
  const MutexLock lock(mutex_);
  return control_.size() + questions_.size() + streams_.size();
}

std::uint64_t Inbound::taken() const {
  const MutexLock lock(mutex_);
  return taken_;
}

}  // namespace cairn::server
