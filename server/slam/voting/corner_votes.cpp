#include <cmath>

#include "server/slam/voting/criteria.h"

namespace cairn::slam {

void VoteByRealCorners(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes) {
  struct Agreement {
    std::size_t ref, curr;
  };
  std::vector<Agreement> agreements;
  std::vector<int> ref_count(scans.ref.corners.size(), 0), curr_count(scans.curr.corners.size(), 0);
  for (std::size_t i = 0; i < scans.ref.corners.size(); ++i) {
    const CornerFeature& ref = scans.ref.corners[i];
    if (!ref.real) continue;
    for (std::size_t j = 0; j < scans.curr.corners.size(); ++j) {
      const CornerFeature& curr = scans.curr.corners[j];
      if (!curr.real || std::abs(AngleDiff(ref.angle, curr.angle)) > options.corner_angle_rad) continue;
      // If both pairs of lines are possible, so is the pair of corners.
      if (!scans.candidates.Has(ref.line_a, curr.line_a) || !scans.candidates.Has(ref.line_b, curr.line_b)) continue;
      agreements.push_back({i, j});
      ++ref_count[i];
      ++curr_count[j];
    }
  }
  for (const Agreement& agreement : agreements) {
    const CornerFeature &ref = scans.ref.corners[agreement.ref], &curr = scans.curr.corners[agreement.curr];
    const bool only_one = ref_count[agreement.ref] == 1 && curr_count[agreement.curr] == 1;
    // Right angles are common, so a unique corner counts half as much as a unique pair in criterion 4.
    const double vote = only_one ? 0.5 * unique : 1.0;
    votes.At(ref.line_a, curr.line_a) += vote;
    votes.At(ref.line_b, curr.line_b) += vote;
  }
}

}  // namespace cairn::slam
