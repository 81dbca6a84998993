#include <algorithm>
#include <cmath>

#include "server/slam/voting/criteria.h"

namespace cairn::slam {

double EndpointTolerance(const LineFeature& ref, const LineFeature& curr, double angle_step_rad) {
  const auto spacing = [&](const LineFeature& line) {
    const double range = line.midpoint().norm();
    const double sin_incidence = std::max(line.distance / std::max(range, 1e-9), 0.2);
    return range * std::tan(angle_step_rad) / sin_incidence;
  };
  return 2.0 * 2.0 * std::max(spacing(ref), spacing(curr));
}

void VoteByLengths(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes) {
  const double step = std::max(scans.ref.angle_step_rad, scans.curr.angle_step_rad);
  const int rows = static_cast<int>(scans.ref.lines.size()), columns = static_cast<int>(scans.curr.lines.size());
  struct Agreement {
    int ref, curr;
  };
  std::vector<Agreement> agreements;
  std::vector<int> ref_count(scans.ref.lines.size(), 0), curr_count(scans.curr.lines.size(), 0);
  for (int i = 0; i < rows; ++i) {
    const LineFeature& ref = scans.ref.lines[static_cast<std::size_t>(i)];
    if (ref.ends != EndClass::kBothEnded) continue;
    for (int j = 0; j < columns; ++j) {
      const LineFeature& curr = scans.curr.lines[static_cast<std::size_t>(j)];
      if (curr.ends != EndClass::kBothEnded || !scans.candidates.Has(i, j)) continue;
      const double tolerance = options.length_floor_m + EndpointTolerance(ref, curr, step);
      const double difference = std::abs(ref.length - curr.length);
      if (difference <= tolerance) {
        agreements.push_back({i, j});
        ++ref_count[static_cast<std::size_t>(i)];
        ++curr_count[static_cast<std::size_t>(j)];
      } else if (difference > tolerance + options.length_negative_m) {
        votes.At(i, j) -= 1.0;
      }
    }
  }
  for (const Agreement& agreement : agreements) {
    const bool only_one = ref_count[static_cast<std::size_t>(agreement.ref)] == 1 &&
                          curr_count[static_cast<std::size_t>(agreement.curr)] == 1;
    votes.At(agreement.ref, agreement.curr) += only_one ? unique : 1.0;
  }
}

}  // namespace cairn::slam
