#include "server/slam/voting/overlap.h"

#include <cmath>

#include "common/geometry/angle.h"

namespace cairn::slam {

OverlapType OverlapTypeOf(const LineFeature& a, const LineFeature& b) {
  const Eigen::Vector2d along = a.direction();
  const double first = along.dot(b.first - a.first), last = along.dot(b.last - a.first);
  if (first > a.length && last > a.length) return OverlapType::kBeyondLast;
  if (first < 0.0 && last < 0.0) return OverlapType::kBeforeFirst;
  return OverlapType::kOverlap;
}

int PatternOverlap(std::span<const double> walked, std::span<const double> other, double tolerance, bool angles,
                   std::vector<std::pair<int, int>>* taken) {
  int score = 0;
  std::size_t next = 0;
  for (std::size_t p = 0; p < walked.size() && next < other.size(); ++p) {
    if (std::isnan(walked[p])) continue;
    for (std::size_t m = next; m < other.size(); ++m) {
      if (std::isnan(other[m])) continue;
      const double difference = angles ? AngleDiff(walked[p], other[m]) : walked[p] - other[m];
      if (std::abs(difference) > tolerance) continue;
      if (taken != nullptr) taken->emplace_back(static_cast<int>(p), static_cast<int>(m));
      ++score;
      next = m + 1;
      break;
    }
  }
  return score;
}

}  // namespace cairn::slam
