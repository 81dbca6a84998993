#include <cmath>

#include "server/slam/voting/criteria.h"

namespace cairn::slam {
namespace {

// The long lines that cannot be confused with a similar line nearby.
std::vector<int> StandingOut(const std::vector<LineFeature>& lines, const ToleranceOptions& options) {
  std::vector<int> found;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].length < options.long_line_m) continue;
    bool rivalled = false;
    for (std::size_t k = 0; k < lines.size() && !rivalled; ++k) {
      if (k == i || lines[k].length < options.long_line_ratio * lines[i].length) continue;
      constexpr double kSameSlope = Radians(15.0);
      if (std::abs(AngleDiff(lines[k].slope, lines[i].slope)) > kSameSlope) continue;
      rivalled = std::abs(lines[i].OffsetOf(lines[k].midpoint())) < options.long_line_apart_m;
    }
    if (!rivalled) found.push_back(static_cast<int>(i));
  }
  return found;
}

}  // namespace

void VoteByLongLines(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes) {
  const std::vector<int> ref = StandingOut(scans.ref.lines, options), curr = StandingOut(scans.curr.lines, options);
  const auto rivals = [&](int i, int j) {
    int count = 0;
    for (const int k : ref) count += k != i && scans.candidates.Has(k, j) ? 1 : 0;
    for (const int k : curr) count += k != j && scans.candidates.Has(i, k) ? 1 : 0;
    return count;
  };
  for (const int i : ref) {
    for (const int j : curr) {
      if (scans.candidates.Has(i, j)) votes.At(i, j) += rivals(i, j) == 0 ? unique : 1.0;
    }
  }
}

}  // namespace cairn::slam
