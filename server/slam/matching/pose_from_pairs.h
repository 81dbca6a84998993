// The robot's motion from pairs of lines: rotation as the length-weighted mean of slope differences, translation from
// the distances of lines near the x axis and lines near the y axis taken two by two, both without outliers.
// Where all lines run one way (corridor) only the part of the translation across them is known.
// Not a matcher: takes the pairs as given. Result as T_prev_curr. Swapping the scans gives the inverse. Stateless,
// thread-safe. Source: thesis A 3.5.12.2-3.5.12.3, Tables 3.27-3.31, Figure 3.30; corridor: 3.5.13.
//
// Differences from the tables. Slope differences weigh by a power of length (an option; Table 3.27 has 1). Table 3.30
// is not printed; the text sums the two distance vectors, which is right only where the lines are perpendicular, so
// each two lines' equations are solved together instead (the same thing when they are). And axes and normals are taken
// half-way between the two headings, so that neither scan is preferred.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/features/line_feature.h"
#include "server/slam/matching/robust_mean.h"
#include "server/slam/matching/vote_table.h"
#include "server/slam/matching/voting_options.h"

namespace cairn::slam {

// What one pair says once the rotation is known: normal . t = offset, in the frame of prev.
struct PairOffset {
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();
  double offset = 0.0;
  double weight = 0.0;  // sqrt(length prev * length curr).
  std::size_t pair = 0;
};

struct RotationEstimate {
  double rotation_rad = 0.0;
  double spread_rad = 0.0;
  int kept = 0;
};

// Nothing where there are no pairs.
[[nodiscard]] std::optional<RotationEstimate> RotationFromPairs(const ScanFeatures& prev, const ScanFeatures& curr,
                                                                std::span<const LinePair> pairs,
                                                                const PoseOptions& options);

// Offsets of the pairs that agree with the rotation within pair_rotation_rad.
[[nodiscard]] std::vector<PairOffset> OffsetsOf(const ScanFeatures& prev, const ScanFeatures& curr,
                                                std::span<const LinePair> pairs, double rotation_rad,
                                                const PoseOptions& options);

struct TranslationEstimate {
  Eigen::Vector2d translation = Eigen::Vector2d::Zero();
  double spread_m = 0.0;
  int kept = 0;             // Candidates behind it.
  bool degenerate = false;  // Only across `along` measured; along it taken from odometry.
  Eigen::Vector2d along = Eigen::Vector2d::Zero();
};

// Nothing where there are no offsets. `odometry`: displacement in prev by odometry, used along a corridor only.
[[nodiscard]] std::optional<TranslationEstimate> TranslationFromOffsets(std::span<const PairOffset> offsets,
                                                                        double rotation_rad,
                                                                        const Eigen::Vector2d& odometry,
                                                                        const PoseOptions& options);

}  // namespace cairn::slam
