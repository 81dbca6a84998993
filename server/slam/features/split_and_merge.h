// The steps of split-and-merge between a Sweep and the lines of ExtractLines, for use inside line extraction
// only. Frames and units are those of Sweep. Stateless.
// Source: thesis A 3.3, 3.4.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "server/slam/features/line_extraction.h"
#include "server/slam/features/line_fit.h"
#include "server/slam/features/sweep.h"

namespace cairn::slam {

// A line during extraction: the hits that belong to it, as indices into a Sweep, and the line fitted through
// them.
struct LineSegment {
  int begin = 0;  // First hit; in [0, size()).
  int end = 0;    // One past the last hit; above size() if the segment crosses the seam of a full turn.
  PointSums sums;
  FittedLine line;
  bool alive = true;

  [[nodiscard]] int count() const { return static_cast<int>(sums.n); }
};

// Largest distance of a hit from the line to which it belongs.
[[nodiscard]] inline double SplitDistance(double range_m, const LineOptions& options) {
  return options.split_m + options.split_per_m * range_m;
}

// Largest distance of a hit at the end of a line from the line through its other hits. It is smaller than
// SplitDistance, because a hit on the next wall just behind a corner would change the slope of this line
// most.
[[nodiscard]] inline double EndDistance(const FittedLine& others, double range_m, const LineOptions& options) {
  return std::min(SplitDistance(range_m, options), std::max(3.0 * others.deviation, 2.0 * options.range_sigma_m));
}

// Distance between the hits of neighbouring beams on the line near `p`.
[[nodiscard]] inline double SpacingAt(const FittedLine& line, const Eigen::Vector2d& laser, const Eigen::Vector2d& p,
                                      double step) {
  const Eigen::Vector2d ray = p - laser;
  const double range = ray.norm();
  const double sin_incidence = std::max(std::abs(line.normal.dot(ray)) / std::max(range, 1e-9), 0.02);
  return range * step / sin_incidence;
}

// Step 1 of split-and-merge: groups the hits that may belong to one surface by their range (3-3). A hit may
// continue any cluster whose last hit lies up to max_gap_rad before it, not only the cluster of the
// neighbouring hit: behind glass, fences and chair legs the beams hit two surfaces in turn, and single stray
// returns must not break a wall. Clusters may therefore interleave.
struct HitClusters {
  std::vector<int> order;  // Indices of the hits, cluster after cluster, each in sweep order.
  // Range [begin, end) of each cluster in `order`. Clusters of fewer than 3 hits are left out.
  std::vector<std::pair<int, int>> runs;
};

[[nodiscard]] HitClusters ClusterHits(const Sweep& sweep, const LineOptions& options);

// Largest number of consecutive beams without an echo that does not break a wall (dark paint, glass).
inline constexpr int kToleratedDropouts = 2;

// Steps 2 and 3 of split-and-merge: each cluster is split until every hit lies near its line (Figure 3.7 a-c).
struct SplitResult {
  std::vector<LineSegment> segments;  // In the order of their first hits; each has at least 2 hits.
  std::vector<int> owner;             // Per hit: index of its segment, or -1 if it has none.
};

[[nodiscard]] SplitResult SplitIntoSegments(const Sweep& sweep, const LineOptions& options);

// Step 4 of split-and-merge: segments on one line are joined across the things that stand in front of it,
// lines are lengthened by hits that continue them, segments that are too short or have too few points are
// dropped, and short lines between parallel ones are straightened (see below). Returns the remaining segments,
// in sweep order of their first hits.
[[nodiscard]] std::vector<LineSegment> MergeSegments(const Sweep& sweep, const LineOptions& options, SplitResult split);

// The last rule of step 4. A line of few points between two parallel lines has an uncertain slope, which also
// moves the corners at its ends. Such a line is turned perpendicular to its neighbours, the best estimate among
// right-angled walls, unless its points contradict that.
void StraightenBetweenParallels(const Sweep& sweep, const LineOptions& options, std::vector<LineSegment>& segments);

// Classifies the ends of a line. An end is real if the beams beyond it pass the line (3-10), or if they hit
// something so close to the end that the line cannot continue behind it (3-11). It is open if something
// nearer hides what follows, if the scan ends there, or if the line goes out of range. Whether a hit is
// farther away is compared with the continuation of the line and not with its last range, so that a box
// in front of a receding wall does not close the end of the wall. Source: 3.4.1, Figure 3.11.
[[nodiscard]] EndClass EndClassOf(const Sweep& sweep, const LineSegment& segment, const LineOptions& options);

}  // namespace cairn::slam
