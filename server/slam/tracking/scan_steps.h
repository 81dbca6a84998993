// The steps in which the mapper spends the time of a scan, for callers who measure it: this library has no clock, so it
// only says when a step begins. Stateless, thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>

namespace cairn::slam {

enum class ScanStep : std::uint8_t {
  kOther = 0,  // Pairing, reports, and what has no step of its own.
  kLook,       // Points, surfaces, lines and corners of the scan, and the motion within it.
  kMatch,      // The chosen matcher.
  kRefine,     // The alignment with the last keyframes.
  kRecover,    // A robot that has to be found again.
  kRevisit,    // Old places that are seen again.
  kFilter,     // The chosen filter: prediction, observations, resampling.
  kLargeLoop,  // The search for large loops, and the path with one.
  kSelfCheck,  // Whether the scan agrees with the old map.
  kDraw,       // The occupancy grid, also when it is drawn again.
  kRetire,     // Keyframes that show nothing new.
};
inline constexpr std::size_t kScanStepCount = 11;
inline constexpr std::array<std::string_view, kScanStepCount> kScanStepNames = {
    "other", "look", "match", "refine", "recover", "revisit", "filter", "large_loop", "self_check", "draw", "retire"};

// Called when a step begins; the step before has ended then. It may be empty.
using StepWatch = std::function<void(ScanStep)>;

inline void Begin(const StepWatch& watch, ScanStep step) {
  if (watch) watch(step);
}

}  // namespace cairn::slam
