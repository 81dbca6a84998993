// Finds the pose in a search window at which a set of points fits best on a reference set. Exhaustive within
// the window down to its cell and angle step, but evaluates few poses. Ambiguity is left to the caller, who
// can search again with the best pose excluded: in a corridor a rival scores almost as high. Frames: points
// in `curr`, pyramid in `ref`. Stateless, thread-safe, deterministic.
// Source: branch and bound of Hess et al., ICRA 2016, section V.
#pragma once

#include <optional>
#include <span>

#include "common/geometry/pose2.h"
#include "server/slam/loops/likelihood_pyramid.h"

namespace cairn::slam {

struct SearchWindow {
  Pose2 T_ref_curr_centre;
  double reach_m = 5.0;    // To either side in x and y.
  double reach_rad = 0.3;  // To either side.
};

struct RegionPeak {
  Pose2 T_ref_curr;
  double score = 0.0;  // Mean likelihood of the points, 0..1.
  // False if the search ended at its bound on work, so that a better pose may have been missed.
  bool complete = true;
};

// Poses this near to `T_ref_curr` are left out.
struct Exclusion {
  Pose2 T_ref_curr;
  double radius_m = 1.0;
  double radius_rad = 0.2;
};

// Returns the best pose with a score above `min_score`, or nothing. At most kMaxBlocks blocks are evaluated.
inline constexpr int kMaxBlocks = 1'000'000;
[[nodiscard]] std::optional<RegionPeak> FindBestPose(std::span<const Eigen::Vector2d> points_curr,
                                                     const LikelihoodPyramid& pyramid, const SearchWindow& window,
                                                     double min_score,
                                                     const std::optional<Exclusion>& exclusion = std::nullopt);

}  // namespace cairn::slam
