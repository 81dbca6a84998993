// Work that the server does in the background: it has an id, a state, a progress and a result, and can be cancelled.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/sensor/stamp.h"
#include "common/service/generation.h"
#include "common/service/names.h"
#include "common/service/pose_report.h"

namespace cairn {

enum class JobKind : std::uint8_t {
  kSmooth = 0,  // Smooths the paths of all robots of a site.
  kJoin,        // The same, but changes nothing unless a robot that was not joined with the map can be joined now.
  kRelocalise,  // Looks for a robot in the map of its site.
};
enum class JobState : std::uint8_t { kQueued = 0, kRunning, kSucceeded, kFailed, kCancelled };
[[nodiscard]] std::string_view JobKindName(JobKind kind);
[[nodiscard]] std::string_view JobStateName(JobState state);
[[nodiscard]] constexpr bool IsFinal(JobState state) {
  return state >= JobState::kSucceeded;
}

struct Job {
  std::uint64_t id = 0;
  std::string site;
  JobKind kind = JobKind::kSmooth;
  JobState state = JobState::kQueued;
  double progress = 0.0;     // 0..1.
  double cost_before = 0.0;  // Meaning per kind; smoothing: mean squared disagreement of scans and map, m^2.
  double cost_after = 0.0;
  std::uint32_t map_version = 0;  // The map version that it published; 0 while there is none.
  Stamp submitted = 0;            // Server clock.
  Stamp started = 0;
  Stamp ended = 0;
  std::string message;
  std::string robot = {};  // kRelocalise: which robot is looked for.
  // kRelocalise: where it may be, the best one first; at most kMostHypotheses.
  std::vector<PoseHypothesis> places = {};
  Generation generation = 0;  // Set by the server's egress.
};

// How much the second of its places is believed over the first, 0..1: near 1 where two places look alike, 0 where there
// is no second one.
[[nodiscard]] double Ambiguity(const Job& job);

}  // namespace cairn
