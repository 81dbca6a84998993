#include "common/service/pose_report.h"

#include <array>

namespace cairn {

std::string_view PoseReasonName(PoseReason reason) {
  static constexpr std::array<std::string_view, 7> kNames = {"tracking", "odometry_only", "degenerate", "lost",
                                                             "diverged", "waiting",       "not_joined"};
  const auto index = static_cast<std::size_t>(reason);
  return index < kNames.size() ? kNames[index] : "unknown";
}

}  // namespace cairn
