// Finds the robot in a known world of straight walls, from nothing: every assignment of the scan's lines to the map's
// that is consistent is a hypothesis of the pose. Not a front-end matcher: it compares a scan with a map, not with a
// scan, and answers several poses; pose_fusion.h fuses one with odometry, filters/line_localization.h makes it a
// filter. The recursion pairs one scan line after the other and gives up a branch at the first pair that cannot be.
// Beyond the algorithm as printed, a scan line may stay unpaired (people, doors) as long as enough of the scan's length
// is left. Frames: map lines in `map`, scan lines in `robot`; answers T_map_robot. Stateless, thread-safe,
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

struct LineMatchOptions {
  double offset_m = 0.12;                      // A scan line lies this near its map line ...
  double slope_rad = Radians(4.0);             // ... and is turned by less against it.
  double overhang_m = 0.25;                    // How far it may stick out beyond the map line's ends.
  double min_line_m = 0.4;                     // Shorter scan lines are not paired.
  double min_share = 0.7;                      // Of the scan lines' length that must be paired.
  double same_m = 0.3;                         // Hypotheses this near each other ...
  double same_rad = Radians(5.0);              // ... are one.
  double line_sigma_m = 0.02;                  // Of a scan line's place, and ...
  double line_slope_sigma_rad = Radians(0.6);  // ... slope: for the covariance.
  // Hard bounds of the search: of its work (a comparison takes some 10 ns; a room of 20 lines needs some ten thousand),
  // and of its answers, of which a map that looks alike everywhere has any number.
  std::int64_t max_comparisons = 20'000'000;
  std::int64_t max_hypotheses = 500;
};
void Visit(OptionVisitor& visitor, LineMatchOptions& options);

// Where the pose must be, as far as is known.
struct LineMatchWindow {
  Pose2 T_map_robot;
  double reach_m = 0.0;   // The answer is not farther from it ...
  double turn_rad = 0.0;  // ... nor turned by more.
};

struct LineMatchHypothesis {
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  double share = 0.0;  // Of the scan lines' length that is paired.
  int pairs = 0;
};

struct LineMatchAnswer {
  std::vector<LineMatchHypothesis> hypotheses;  // The largest share first.
  bool complete = true;                         // False: A bound ended the search.
};

// Answers outside of the window are left out, which makes it faster by orders of magnitude.
[[nodiscard]] LineMatchAnswer MatchLinesWithMap(std::span<const MapLine> map, std::span<const LineFeature> scan,
                                                const LineMatchOptions& options,
                                                const std::optional<LineMatchWindow>& window = std::nullopt);

}  // namespace cairn::slam
