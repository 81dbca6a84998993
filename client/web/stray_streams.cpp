#include "client/web/stray_streams.h"

#include <fmt/format.h>

namespace cairn::web {
namespace {

std::uint64_t Count(const Ledger& ledger, DropReason reason) {
  return ledger.dropped[static_cast<std::size_t>(reason)];
}

}  // namespace

Result<std::unique_ptr<StrayStreams>> StrayStreams::Create(wire::Bus& bus) {
  auto strays = std::make_unique<StrayStreams>();
  auto ledgers = bus.Subscribe<Ledger>([self = strays.get()](Ledger&& ledger) { self->Take(ledger, Clock::now()); });
  if (!ledgers) return tl::unexpected(ledgers.error());
  strays->subscriptions_.push_back(std::move(*ledgers));
  auto refusals = bus.Subscribe<SessionRefusal>(
      [self = strays.get()](SessionRefusal&& refusal) { self->Take(refusal, Clock::now()); });
  if (!refusals) return tl::unexpected(refusals.error());
  strays->subscriptions_.push_back(std::move(*refusals));
  return strays;
}

void StrayStreams::Take(const Ledger& ledger, Clock::time_point now) {
  const std::pair key(ledger.robot_id, ledger.sensor_id);
  const MutexLock lock(mutex_);
  if (!ledger.robot.empty()) {  // It has a session.
    streams_.erase(key);
    refusals_.erase(ledger.robot_id);
    return;
  }
  Forget(now);
  const std::uint64_t not_owner = Count(ledger, DropReason::kNotOwner);
  const std::uint64_t dropped = Count(ledger, DropReason::kNoSession) + not_owner;
  const auto found = streams_.find(key);
  if (found == streams_.end()) {
    if (streams_.size() < kMaxStrays) streams_[key] = {.dropped = dropped, .not_owner = not_owner > 0, .heard = now};
    return;
  }
  Stream& stream = found->second;
  // A server that was started again counts anew.
  if (dropped > stream.dropped) stream.grown = now;
  stream.dropped = dropped;
  stream.not_owner = not_owner > 0;
  stream.heard = now;
}

void StrayStreams::Take(const SessionRefusal& refusal, Clock::time_point now) {
  const SessionState& state = refusal.state;
  const MutexLock lock(mutex_);
  Forget(now);
  if (refusals_.count(state.robot_id) == 0 && refusals_.size() >= kMaxStrays) return;
  refusals_[state.robot_id] = {.robot = state.robot, .why = state.status.message, .heard = now};
}

void StrayStreams::Forget(Clock::time_point now) {
  constexpr std::chrono::minutes kForgottenAfter{10};  // As the server does.
  const auto old = [&](const auto& entry) { return now - entry.second.heard > kForgottenAfter; };
  std::erase_if(streams_, old);
  std::erase_if(refusals_, old);
}

std::vector<StrayStream> StrayStreams::Shown(Clock::time_point now) const {
  const MutexLock lock(mutex_);
  std::vector<StrayStream> shown;
  for (const auto& [key, stream] : streams_) {
    if (stream.grown == Clock::time_point{} || now - stream.grown > kShownFor) continue;
    const auto refusal = refusals_.find(key.first);
    StrayStream stray;
    stray.dropped = stream.dropped;
    stray.robot = refusal != refusals_.end() ? refusal->second.robot : fmt::format("number {:016x}", key.first);
    if (refusal != refusals_.end()) {
      stray.why = "the server refuses its session: " + refusal->second.why;
    } else if (stream.not_owner) {
      stray.why = "another program has the session of this robot: is its name used twice?";
    } else {
      stray.why = "it sends scans, but has opened no session";
    }
    shown.push_back(std::move(stray));
  }
  return shown;
}

}  // namespace cairn::web
