// Scans that belong to no session, counted per stream as no_session. The table is bounded, so that a client that
// invents stream ids costs a fixed amount of memory. Streams beyond the bound are counted together in overflow(). A
// stream that has been silent for kForgottenAfter is forgotten. Not thread-safe: the roster's lock guards it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "common/service/stream.h"
#include "server/robots/stream_ledger.h"

namespace cairn::server {

class UnclaimedStreams {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::minutes kForgottenAfter{10};

  explicit UnclaimedStreams(std::size_t max_streams) : max_streams_(max_streams) {}

  void Count(const StreamId& stream, std::uint64_t sequence, DropReason reason, Clock::time_point now);
  // The counts of a stream whose session has just been opened, if samples arrived under its name before. If they
  // belonged to another session, the numbers begin again.
  [[nodiscard]] std::optional<StreamLedger> Claim(const StreamId& stream);
  // Accounts that changed since the last call.
  [[nodiscard]] std::vector<Ledger> TakeChanged();
  // Forgets the silent streams whose account `retire` accepts (it gives back the key on the wire; false: later).
  void ForgetSilent(Clock::time_point now, const std::function<bool(const Ledger&)>& retire);
  [[nodiscard]] std::uint64_t overflow() const { return overflow_; }

 private:
  struct Account {
    StreamLedger ledger;
    SessionToken session = 0;  // Session of the last sample.
    Clock::time_point counted{};
    bool changed = true;

    void NextIn(SessionToken next) {
      if (std::exchange(session, next) != next) ledger.NewClient();
    }
  };
  const std::size_t max_streams_;
  std::map<std::pair<NameId, NameId>, Account> accounts_;
  std::uint64_t overflow_ = 0;
};

}  // namespace cairn::server
