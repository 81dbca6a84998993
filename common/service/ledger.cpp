#include "common/service/ledger.h"

#include <array>
#include <numeric>

namespace cairn {

std::string_view DropReasonName(DropReason reason) {
  static constexpr std::array<std::string_view, kDropReasonCount> kNames = {
      "no_odometry", "duplicate_stamp", "stamp_went_back", "stamp_jump",   "bad_geometry",  "too_many_beams", "empty",
      "no_session",  "not_owner",       "queue_full",      "lost_on_wire", "session_ended", "session_full"};
  const auto index = static_cast<std::size_t>(reason);
  return index < kNames.size() ? kNames[index] : "unknown";
}

DropReason DropReasonOf(ScanFault fault) {
  switch (fault) {
    case ScanFault::kEmpty:
      return DropReason::kEmpty;
    case ScanFault::kTooManyBeams:
      return DropReason::kTooManyBeams;
    case ScanFault::kBadGeometry:
      break;
  }
  return DropReason::kBadGeometry;
}

std::uint64_t Ledger::dropped_total() const {
  return std::accumulate(dropped.begin(), dropped.end(), std::uint64_t{0});
}

}  // namespace cairn
