#include <cmath>

#include "server/slam/matching/criteria.h"

namespace cairn::slam {

void VoteByRealCorners(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes) {
  struct Agreement {
    std::size_t prev, curr;
  };
  std::vector<Agreement> agreements;
  std::vector<int> prev_count(scans.prev.corners.size(), 0), curr_count(scans.curr.corners.size(), 0);
  for (std::size_t i = 0; i < scans.prev.corners.size(); ++i) {
    const CornerFeature& prev = scans.prev.corners[i];
    if (!prev.real) continue;
    for (std::size_t j = 0; j < scans.curr.corners.size(); ++j) {
      const CornerFeature& curr = scans.curr.corners[j];
      if (!curr.real || std::abs(AngleDiff(prev.angle, curr.angle)) > options.corner_angle_rad) continue;
      // Both lines within the robot's limits puts the corner within them.
      if (!scans.candidates.Has(prev.line_a, curr.line_a) || !scans.candidates.Has(prev.line_b, curr.line_b)) continue;
      agreements.push_back({i, j});
      ++prev_count[i];
      ++curr_count[j];
    }
  }
  for (const Agreement& agreement : agreements) {
    const CornerFeature &prev = scans.prev.corners[agreement.prev], &curr = scans.curr.corners[agreement.curr];
    const bool only_one = prev_count[agreement.prev] == 1 && curr_count[agreement.curr] == 1;
    const double vote = only_one ? 0.5 * unique : 1.0;  // Right angles are common: half the surety of criterion 4.
    votes.At(prev.line_a, curr.line_a) += vote;
    votes.At(prev.line_b, curr.line_b) += vote;
  }
}

}  // namespace cairn::slam
