// Finds the robot in a known map of straight walls without a prior: every consistent assignment of the scan's
// lines to the map's lines is a hypothesis of the pose. Not a front-end matcher: it compares a scan with a
// map, not with a scan, and returns several poses; place_hypotheses.h fuses one of them with odometry,
// line_localization.h is the filter.
// The recursion assigns one scan line after the other and abandons a branch at the first impossible pair.
// There are two ways to assign (LineMatchPairing): the algorithm as printed, and ours, in which a scan line
// may also stay unassigned (people, doors) as long as enough of the scan's length is assigned.
// Frames: map lines in `map`, scan lines in `robot`; returns T_map_robot. Stateless, thread-safe,
// deterministic. Source: thesis B 2.2.2, Algorithm 1 (LINEMATCH); Gutmann, Weigel, Nebel, 1999.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/geometry/angle.h"
#include "common/geometry/pose2.h"
#include "common/map/map_lines.h"
#include "common/options/option_visitor.h"
#include "server/slam/features/line_feature.h"

namespace cairn::slam {

enum class LineMatchPairing : std::uint8_t {
  // Only the first two pairs are tried in every way; each further line is assigned to the wall on which it
  // lies, or to none.
  kFirstTwo = 0,
  // Algorithm 1 as printed: every scan line is tried with every wall that fits, and none may stay unassigned.
  kRecursive,
};

struct LineMatchOptions {
  LineMatchPairing pairing = LineMatchPairing::kFirstTwo;
  double offset_m = 0.12;
  double slope_rad = Radians(4.0);
  double overhang_m = 0.25;
  double min_line_m = 0.4;
  double min_share = 0.7;
  double same_m = 0.3;
  double same_rad = Radians(5.0);
  double line_sigma_m = 0.02;
  double line_slope_sigma_rad = Radians(0.6);
  std::int64_t max_comparisons = 20'000'000;  // A room of 20 lines needs some ten thousand.
  std::int64_t max_hypotheses = 500;
};
void Visit(OptionVisitor& visitor, LineMatchOptions& options);

// The poses to which a search is restricted.
struct LineMatchWindow {
  Pose2 T_map_robot;
  double reach_m = 0.0;   // Largest distance from T_map_robot.
  double turn_rad = 0.0;  // Largest difference of the heading.
};

struct LineMatchHypothesis {
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  double share = 0.0;  // Assigned share of the scan lines' length.
  int pairs = 0;
};

struct LineMatchAnswer {
  std::vector<LineMatchHypothesis> hypotheses;  // Ordered by share, the largest first.
  bool complete = true;                         // False if a bound ended the search.
};

// Hypotheses outside of the window are left out, which makes the search faster by orders of magnitude.
[[nodiscard]] LineMatchAnswer MatchLinesWithMap(std::span<const MapLine> map, std::span<const LineFeature> scan,
                                                const LineMatchOptions& options,
                                                const std::optional<LineMatchWindow>& window = std::nullopt);

}  // namespace cairn::slam
