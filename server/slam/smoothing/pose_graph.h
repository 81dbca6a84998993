// The path as a graph: poses, what is known between following ones (the matched motion) and between distant ones
// (places seen again), and the path that fits all of it best. Relations that contradict the rest are outvoted, not
// obeyed. Not a loop detector. Poses in one frame, `map`; node 0 stays where it is. Stateless, thread-safe,
// deterministic (one thread).
// Source: Lu and Milios 1997 (network of pose relations); least squares by Ceres; robust loss of Cauchy, narrowed in
// steps as in graduated non-convexity (Blake and Zisserman 1987; Yang et al. 2020), because a large loop begins many
// standard deviations off and would otherwise count as wrong.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct PoseRelation {
  std::size_t from = 0;
  std::size_t to = 0;
  Pose2 T_from_to;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  // Of (x, y, theta) of T_from_to; positive definite.
  bool loop = false;                                         // May be wrong: under the robust loss.
};

struct PoseGraphOptions {
  bool enabled =
      true;  // Smoothing fits the relations; off, it answers with the path of the best particle (thesis A 5.4).
  std::int64_t max_iterations = 20;
  double loop_loss = 3.0;  // Standard deviations a loop may be off before its pull weakens.
};
void Visit(OptionVisitor& visitor, PoseGraphOptions& options);

struct PoseGraphSummary {
  double cost_before = 0.0;  // Half the sum of squared normalised errors, after the loss.
  double cost_after = 0.0;
  int iterations = 0;
  bool usable = false;  // `poses` hold a better path than before.
};

// The error (from, to) have of a relation, (x, y, theta) in `from`, and its derivatives by both poses.
struct PoseRelationError {
  Eigen::Vector3d error;
  Eigen::Matrix3d J_error_from;
  Eigen::Matrix3d J_error_to;
};
[[nodiscard]] PoseRelationError ErrorOf(const PoseRelation& relation, const Pose2& T_map_from, const Pose2& T_map_to);

// Moves `poses` to the best path; leaves them where nothing better was found. REQUIRES: indices within poses.
PoseGraphSummary OptimisePoses(std::vector<Pose2>& poses, std::span<const PoseRelation> relations,
                               const PoseGraphOptions& options);

}  // namespace cairn::slam
