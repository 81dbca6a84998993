#include "common/service/pose_report.h"

#include <array>

namespace cairn {

std::string_view PoseReasonName(PoseReason reason) {
  static constexpr std::array<std::string_view, 6> kNames = {"tracking", "odometry_only", "degenerate",
                                                             "lost",     "diverged",      "waiting"};
  const auto index = static_cast<std::size_t>(reason);
  return index < kNames.size() ? kNames[index] : "unknown";
}

}  // namespace cairn
