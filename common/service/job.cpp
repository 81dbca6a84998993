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

double Ambiguity(const Job& job) {
  if (job.places.size() < 2 || !(job.places[0].weight > 0.0)) return 0.0;
  return job.places[1].weight / job.places[0].weight;
}

}  // namespace cairn
