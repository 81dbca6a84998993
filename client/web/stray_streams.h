// Robots whose scans the server drops because they belong to no session: nobody sees such a robot on the map. The
// server says so in ledgers without a name and, where it was asked for a session, in refusals. Bounded: kMaxStrays
// streams and as many refusals; further ones are not seen. A stream is shown while its count has grown in the last
// kShownFor. Thread rule: every method from any thread.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "common/service/ledger.h"
#include "common/service/session.h"
#include "common/wire/bus.h"

namespace cairn::web {

struct StrayStream {
  std::string robot;  // Its name where the server has refused it a session, else the number that stands for the name.
  std::uint64_t dropped = 0;
  std::string why;

  bool operator==(const StrayStream&) const = default;
};

class StrayStreams {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t kMaxStrays = 256;
  static constexpr std::chrono::seconds kShownFor{10};

  // `bus` outlives it.
  [[nodiscard]] static Result<std::unique_ptr<StrayStreams>> Create(wire::Bus& bus);

  // As if it had arrived.
  void Take(const Ledger& ledger, Clock::time_point now);
  void Take(const SessionRefusal& refusal, Clock::time_point now);
  [[nodiscard]] std::vector<StrayStream> Shown(Clock::time_point now) const;

 private:
  struct Stream {
    std::uint64_t dropped = 0;
    bool not_owner = false;     // Another client owns the session of the robot.
    Clock::time_point heard{};  // Its last ledger.
    Clock::time_point grown{};  // Zero: its first ledger, which may be old.
  };
  struct Refusal {
    std::string robot;
    std::string why;
    Clock::time_point heard{};
  };
  void Forget(Clock::time_point now) CAIRN_REQUIRES(mutex_);

  mutable Mutex mutex_;
  std::map<std::pair<NameId, NameId>, Stream> streams_ CAIRN_GUARDED_BY(mutex_);  // By robot and sensor.
  std::map<NameId, Refusal> refusals_ CAIRN_GUARDED_BY(mutex_);                   // By robot.
  std::vector<std::unique_ptr<wire::Subscription>> subscriptions_;  // Last: their callbacks use everything above.
};

}  // namespace cairn::web
