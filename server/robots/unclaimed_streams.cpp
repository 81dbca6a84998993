#include "server/robots/unclaimed_streams.h"

namespace cairn::server {

void UnclaimedStreams::Count(const StreamId& stream, std::uint64_t sequence, DropReason reason, Clock::time_point now) {
  const std::pair key(stream.robot_id, stream.sensor_id);
  auto found = accounts_.find(key);
  if (found == accounts_.end()) {
    if (accounts_.size() >= max_streams_) {
      ++overflow_;
      return;
    }
    Ledger names;
    names.robot_id = stream.robot_id;
    names.sensor_id = stream.sensor_id;
    found = accounts_.emplace(key, Account{StreamLedger(names), stream.session}).first;
  }
  Account& account = found->second;
  account.changed = true;
  account.counted = now;
  if (reason == DropReason::kNotOwner) {
    account.ledger.DroppedForeign(reason);
    return;
  }
  account.NextIn(stream.session);
  if (account.ledger.Received(sequence)) account.ledger.Dropped(sequence, reason);
}

std::optional<StreamLedger> UnclaimedStreams::Claim(const StreamId& stream) {
  auto node = accounts_.extract({stream.robot_id, stream.sensor_id});
  if (node.empty()) return std::nullopt;
  node.mapped().NextIn(stream.session);
  return std::move(node.mapped().ledger);
}

std::vector<Ledger> UnclaimedStreams::TakeChanged() {
  std::vector<Ledger> changed;
  for (auto& [key, account] : accounts_) {
    if (!account.changed) continue;
    account.changed = false;
    changed.push_back(account.ledger.ledger());
  }
  return changed;
}

void UnclaimedStreams::ForgetSilent(Clock::time_point now, const std::function<bool(const Ledger&)>& retire) {
  std::erase_if(accounts_, [&](const auto& stream) {
    return now - stream.second.counted > kForgottenAfter && retire(stream.second.ledger.ledger());
  });
}

}  // namespace cairn::server
