// A parameter of a robot that its estimator has learned while the robot drove, for example by how much its wheels
// count too far.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace cairn {

struct LearnedValue {
  std::string name;  // As in the options of the estimator, where there is one.
  std::string unit;  // "m", "rad", "s", or "1" for a ratio.
  double value = 0.0;
  double sigma = 0.0;    // Standard deviation of the value.
  bool applied = false;  // The estimator uses it; otherwise it is not sure enough yet, or learning is switched off.
  [[nodiscard]] bool operator==(const LearnedValue&) const = default;
};
inline constexpr std::size_t kMostLearned = 16;

// Two that are no parameters, with the value 1: the robot is followed by its scans alone, because it sends no odometry,
// or because its odometry stands still although its scans move.
inline constexpr std::string_view kLearnedNoOdometry = "no_odometry", kLearnedOdometryStands = "odometry_stands";
// What it says, for a reader.
[[nodiscard]] std::string TextOf(const LearnedValue& learned);

}  // namespace cairn
