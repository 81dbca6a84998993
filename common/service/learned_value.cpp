#include "common/service/learned_value.h"

#include <array>
#include <cstdio>

namespace cairn {

std::string TextOf(const LearnedValue& learned) {
  if (learned.name == kLearnedNoOdometry) return "no odometry: followed by its scans alone";
  if (learned.name == kLearnedOdometryStands)
    return "its odometry stands still although its scans move: followed by its scans alone";
  std::array<char, 64> numbers{};
  std::snprintf(numbers.data(), numbers.size(), " %.4f +- %.4f", learned.value, learned.sigma);
  return "learned " + learned.name + numbers.data() + (learned.unit == "1" ? "" : ' ' + learned.unit);
}

}  // namespace cairn
