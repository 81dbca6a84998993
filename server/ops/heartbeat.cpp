#include "server/ops/heartbeat.h"

#include <utility>

namespace cairn::server {

std::vector<std::string> Heartbeat::Check(const std::map<std::string, Ask>& strands, Clock::time_point now) {
  std::vector<std::string> stalled;
  std::map<std::string, Beat> beats;
  for (const auto& [name, ask] : strands) {
    auto old = beats_.extract(name);
    if (!old.empty() && !*old.mapped().answered) {
      if (now - old.mapped().asked > limit_) stalled.push_back(name);
      beats.insert(std::move(old));
      continue;
    }
    Beat beat{std::make_shared<std::atomic<bool>>(false), now};
    // A strand that takes nothing counts as asked: it is stalled if that lasts.
    if (!ask([answered = beat.answered] { *answered = true; })) beat.asked = now;
    beats.emplace(name, std::move(beat));
  }
  beats_ = std::move(beats);
  return stalled;
}

}  // namespace cairn::server
