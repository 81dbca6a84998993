#include "common/service/job.h"

#include <array>

namespace cairn {

std::string_view JobKindName(JobKind kind) {
  static constexpr std::array<std::string_view, 3> kNames = {"smooth", "join", "relocalise"};
  const auto index = static_cast<std::size_t>(kind);
  return index < kNames.size() ? kNames[index] : "unknown";
}

std::string_view JobStateName(JobState state) {
  static constexpr std::array<std::string_view, 5> kNames = {"queued", "running", "succeeded", "failed", "cancelled"};
  const auto index = static_cast<std::size_t>(state);
  return index < kNames.size() ? kNames[index] : "unknown";
}

}  // namespace cairn
