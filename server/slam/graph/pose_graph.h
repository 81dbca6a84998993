// The path as a graph: the nodes are poses, and the relations are relative poses between consecutive nodes
// (matched motion) or distant ones (loops: places that were seen again). Computes the path that fits all
// relations best; a robust loss reduces the influence of loops that contradict the rest. Not a loop detector.
// All poses are in one frame, `map`; node 0 stays where it is. Stateless, thread-safe, deterministic (one
// thread).
// Source: Lu and Milios 1997 (network of pose relations); least squares by Ceres; robust loss of Cauchy,
// narrowed in steps as in graduated non-convexity (Blake and Zisserman 1987; Yang et al. 2020), because the
// error of a large loop starts at many standard deviations and would otherwise be treated as an outlier.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

struct PoseRelation {
  std::size_t from = 0;
  std::size_t to = 0;
  Pose2 T_from_to;
  // Covariance of (x, y, theta) of T_from_to; positive definite.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  bool loop = false;  // True for a loop, which may be wrong and therefore has the robust loss.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.from, self.to, self.T_from_to, self.covariance, self.loop);
  }
};

struct PoseGraphOptions {
  bool enabled = true;  // False: thesis A 5.4.
  std::int64_t max_iterations = 20;
  double tolerance = 1e-4;  // Relative change of the cost at which the least squares stop; not in the configuration.
};
void Visit(OptionVisitor& visitor, PoseGraphOptions& options);

struct PoseGraphSummary {
  double cost_before = 0.0;  // Half the sum of squared normalised errors, after the robust loss.
  double cost_after = 0.0;
  int iterations = 0;
  bool usable = false;     // `poses` were moved; their cost is at most that of the path before.
  bool cancelled = false;  // `go_on` returned false; `poses` are unchanged.
};

// Whether so few loops hold a path that one wrong one, which no other contradicts, may have bent it. Then scans have to
// judge the path that fits them (smoothing/smoothed_map.h).
[[nodiscard]] bool HasFewLoops(std::span<const PoseRelation> relations);

// The error (x, y, theta) of a relation at the given poses, in the frame `from`, and its derivatives by both
// poses.
struct PoseRelationError {
  Eigen::Vector3d error;
  Eigen::Matrix3d J_error_from;
  Eigen::Matrix3d J_error_to;
};
[[nodiscard]] PoseRelationError ErrorOf(const PoseRelation& relation, const Pose2& T_map_from, const Pose2& T_map_to);

// Weight of a loop in the fit, 0..1, by its squared normalised error: the robust loss of the last step.
[[nodiscard]] double LoopWeight(double squared_error);

// Moves `poses` to the path that fits best, or leaves them unchanged if no better one is found; the first `held` of
// them stay where they are. If `go_on` is given, it is called after each iteration of the solver, and the work ends
// when it returns false. REQUIRES: the indices of all relations lie within poses; held >= 1.
PoseGraphSummary OptimisePoses(std::vector<Pose2>& poses, std::span<const PoseRelation> relations,
                               const PoseGraphOptions& options, const std::function<bool()>& go_on = {},
                               std::size_t held = 1);

}  // namespace cairn::slam
