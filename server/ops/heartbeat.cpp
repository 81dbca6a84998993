#include "server/ops/heartbeat.h"

#include <utility>

namespace cairn::server {

std::vector<std::string> Heartbeat::Check(const std::map<std::string, Pulse>& pulses, Clock::time_point now) {
  std::vector<std::string> stalled;
  std::map<std::string, Beat> beats;
  for (const auto& [name, pulse] : pulses) {
    const auto old = beats_.find(name);
    const bool stands = old != beats_.end() && pulse.busy && pulse.finished == old->second.finished;
    const Beat beat{pulse.finished, stands ? old->second.moved : now};
    if (now - beat.moved > limit_) stalled.push_back(name);
    beats.emplace(name, beat);
  }
  beats_ = std::move(beats);
  return stalled;
}

}  // namespace cairn::server
