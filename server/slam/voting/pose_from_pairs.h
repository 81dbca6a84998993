// The robot's motion from pairs of lines. The rotation is the length-weighted mean of the slope differences.
// The translation follows from the distances of lines near the x axis and lines near the y axis, taken two by
// two. Outliers are removed from both. If all lines have one direction (corridor), only the part of the
// translation across them is known.
// Not a matcher: the pairs are taken as given. The result is T_ref_curr. Swapping the scans gives the
// inverse. Stateless, thread-safe. Source: thesis A 3.5.12.2-3.5.12.3, Tables 3.27-3.31, Figure 3.30;
// corridor: 3.5.13.
//
// Differences from the tables. Slope differences are weighted by a power of the length (an option; Table 3.27
// has 1). Table 3.30 is not printed; the text adds the two distance vectors, which is right only if the lines
// are perpendicular. Here the two equations of each two lines are solved together, which gives the same
// result for perpendicular lines. Axes and normals are taken half-way between the two headings, so that
// neither scan is preferred.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/matching/vote_table.h"
#include "server/slam/voting/voting_options.h"

namespace cairn::slam {

// The weighted mean of Tables 3.27 and 3.31: the value farthest from the mean is removed, one at a time,
// until all remaining values lie within `spread` of their mean, or only `keep` values remain. Stateless,
// thread-safe.
// For plain numbers the second component is 0. Source: thesis A 3.5.12.2-3.5.12.3.
struct WeightedVector {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  double weight = 0.0;
};

struct RobustMean {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double spread = 0.0;  // Largest distance from the mean among the values kept.
  int kept = 0;         // 0 if there were no values of positive weight.
};

[[nodiscard]] RobustMean MeanWithoutOutliers(std::vector<WeightedVector> values, double spread, int keep);

// The equation that one pair gives for the translation t when the rotation is known: normal . t = offset, in
// the frame of ref.
struct PairOffset {
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();
  double offset = 0.0;
  double weight = 0.0;  // sqrt(length ref * length curr).
  std::size_t pair = 0;
};

struct RotationEstimate {
  double rotation_rad = 0.0;
  int kept = 0;
};

// Nothing if there are no pairs.
[[nodiscard]] std::optional<RotationEstimate> RotationFromPairs(const ScanFeatures& ref, const ScanFeatures& curr,
                                                                std::span<const LinePair> pairs,
                                                                const PoseOptions& options);

// Offsets of the pairs that agree with the rotation within pair_rotation_rad.
[[nodiscard]] std::vector<PairOffset> OffsetsOf(const ScanFeatures& ref, const ScanFeatures& curr,
                                                std::span<const LinePair> pairs, double rotation_rad,
                                                const PoseOptions& options);

struct TranslationEstimate {
  Eigen::Vector2d translation = Eigen::Vector2d::Zero();
  double spread_m = 0.0;
  int kept = 0;             // Number of candidates that were averaged.
  bool degenerate = false;  // Only the part across `along` was measured; the part along it is from odometry.
  Eigen::Vector2d along = Eigen::Vector2d::Zero();
};

// Nothing if there are no offsets. `odometry` is the displacement in ref by odometry, which is used along a
// corridor only.
[[nodiscard]] std::optional<TranslationEstimate> TranslationFromOffsets(std::span<const PairOffset> offsets,
                                                                        double rotation_rad,
                                                                        const Eigen::Vector2d& odometry,
                                                                        const PoseOptions& options);

}  // namespace cairn::slam
