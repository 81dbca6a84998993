#include "server/door_losses.h"

namespace cairn::server {

std::string TextOf(const DoorCounts& counts) {
  std::string text;
  const auto add = [&text](std::uint64_t count, const char* what) {
    if (count == 0) return;
    if (!text.empty()) text += ", ";
    text += std::to_string(count) + ' ' + what;
  };
  add(counts.inbound_full, "received (inbound channel full)");
  add(counts.malformed, "malformed");
  add(counts.uncounted_scans, "scans of too many unknown streams");
  add(counts.outbound_full, "to send (outbound lane full)");
  add(counts.unpublished, "not accepted by DDS in time");
  return text.empty() ? "nothing" : text;
}

std::optional<std::string> DoorLosses::Check(const DoorCounts& counts, Clock::time_point now) {
  if (counts == told_ || (told_at_ && now - *told_at_ < kPeriod)) return std::nullopt;
  const DoorCounts since{.inbound_full = counts.inbound_full - told_.inbound_full,
                         .malformed = counts.malformed - told_.malformed,
                         .uncounted_scans = counts.uncounted_scans - told_.uncounted_scans,
                         .outbound_full = counts.outbound_full - told_.outbound_full,
                         .unpublished = counts.unpublished - told_.unpublished};
  told_ = counts;
  told_at_ = now;
  return "messages lost between DDS and the server: " + TextOf(since) + "; since the start: " + TextOf(counts);
}

}  // namespace cairn::server
