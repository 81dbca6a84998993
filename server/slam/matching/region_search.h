// Where a set of points fits best on a reference set, over a whole window of poses: the best pose and how good the best
// one elsewhere is. Exhaustive within the window down to its cell and angle step, but visits few poses. Ambiguity is
// the caller's business: a corridor's answer has an almost equal rival. Frames: points in `curr`, pyramid in `ref`.
// Stateless, thread-safe, deterministic. Source: branch and bound of Hess et al., ICRA 2016, section V.
#pragma once

#include <optional>
#include <span>

#include "common/geometry/pose2.h"
#include "server/slam/matching/likelihood_pyramid.h"

namespace cairn::slam {

struct SearchWindow {
  Pose2 T_ref_curr_centre;
  double reach_m = 5.0;    // Either way in x and y.
  double reach_rad = 0.3;  // Either way.
};

struct RegionPeak {
  Pose2 T_ref_curr;
  double score = 0.0;    // 0..1: mean likelihood of the points.
  bool complete = true;  // False: the search gave up at its bound on work, and a better pose may have been missed.
};

// Poses within this of `T_ref_curr` are left out.
struct Exclusion {
  Pose2 T_ref_curr;
  double radius_m = 1.0;
  double radius_rad = 0.2;
};

// The best pose with a score above `min_score`; nothing where there is none. Never more than kMaxBlocks blocks are
// scored.
inline constexpr int kMaxBlocks = 1'000'000;
[[nodiscard]] std::optional<RegionPeak> FindBestPose(std::span<const Eigen::Vector2d> points_curr,
                                                     const LikelihoodPyramid& pyramid, const SearchWindow& window,
                                                     double min_score,
                                                     const std::optional<Exclusion>& exclusion = std::nullopt);

}  // namespace cairn::slam
