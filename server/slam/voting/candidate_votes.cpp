#include <algorithm>
#include <cmath>

#include "server/slam/voting/criteria.h"

namespace cairn::slam {

CandidateTable VoteByPossibility(const ScanFeatures& ref, const ScanFeatures& curr, const Pose2& T_ref_curr_odometry,
                                 const CandidateOptions& options, const VoteWeightOptions& weights, VoteTable& votes) {
  const int rows = static_cast<int>(ref.lines.size()), columns = static_cast<int>(curr.lines.size());
  CandidateTable candidates(rows, columns);
  for (int j = 0; j < columns; ++j) {
    const LineFeature& line = curr.lines[static_cast<std::size_t>(j)];
    const Eigen::Vector2d mid_curr = T_ref_curr_odometry * line.midpoint();
    const double slope = WrapAngle(line.slope + T_ref_curr_odometry.theta);
    const Eigen::Vector2d normal(-std::sin(slope), std::cos(slope));
    for (int i = 0; i < rows; ++i) {
      const LineFeature& other = ref.lines[static_cast<std::size_t>(i)];
      const double turn = std::abs(AngleDiff(other.slope, slope));
      double vote = weights.impossible;
      if (turn <= options.max_rotation_rad) {
        // The offset is the mean distance of each line's midpoint from the other line, so that swapping the
        // scans changes nothing. The midpoints may lie far apart along the wall; the error that the unknown
        // turn causes over that distance is allowed in addition.
        const Eigen::Vector2d between = mid_curr - other.midpoint();
        const double offset = 0.5 * std::abs((other.left_normal() + normal).dot(between));
        const double allowed = options.max_translation_m + 0.5 * turn * between.norm();
        if (offset <= allowed) {
          candidates.Add(i, j);
          const double off = turn / std::max(options.max_rotation_rad, 1e-9) + offset / std::max(allowed, 1e-9);
          vote = weights.possible * (1.0 + std::max(0.0, 1.0 - off));
        }
      }
      votes.At(i, j) = vote;
    }
  }
  return candidates;
}

}  // namespace cairn::slam
