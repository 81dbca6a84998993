#include "common/service/session.h"

#include <array>

namespace cairn {

std::string_view SessionPhaseName(SessionPhase phase) {
  static constexpr std::array<std::string_view, 4> kNames = {"active", "refused", "ended", "suspended"};
  const auto index = static_cast<std::size_t>(phase);
  return index < kNames.size() ? kNames[index] : "unknown";
}

}  // namespace cairn
