// The poses of a path, one for each keyframe or scan, in a sequence that hypotheses share (shared_sequence.h) and that
// finds its poses near a position without looking at all of them: every node knows the box around the positions below
// it. Thread rule: that of SharedSequence.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <limits>

#include "common/geometry/pose2.h"
#include "server/slam/trail/shared_sequence.h"

namespace cairn::slam {

// A box that contains positions, in the frame of the path, in metres.
class PathBounds {
 public:
  void Add(const Pose2& pose) { Extend(pose.x, pose.y, pose.x, pose.y); }
  void Add(const PathBounds& part) { Extend(part.low_x_, part.low_y_, part.high_x_, part.high_y_); }
  // False only if every position in the box is more than `distance_m` away from `p`.
  [[nodiscard]] bool IsWithin(double distance_m, const Eigen::Vector2d& p) const {
    constexpr double kRoundingM = 1e-6;  // More than the rounding of a distance.
    const double reach_m = distance_m + kRoundingM;
    const double dx = std::max({low_x_ - p.x(), p.x() - high_x_, 0.0});
    const double dy = std::max({low_y_ - p.y(), p.y() - high_y_, 0.0});
    return dx * dx + dy * dy <= reach_m * reach_m;
  }

 private:
  void Extend(double low_x, double low_y, double high_x, double high_y) {
    low_x_ = std::min(low_x_, low_x);
    low_y_ = std::min(low_y_, low_y);
    high_x_ = std::max(high_x_, high_x);
    high_y_ = std::max(high_y_, high_y);
  }

  double low_x_ = std::numeric_limits<double>::infinity();
  double low_y_ = std::numeric_limits<double>::infinity();
  double high_x_ = -std::numeric_limits<double>::infinity();
  double high_y_ = -std::numeric_limits<double>::infinity();
};

// T_map_robot of each keyframe or scan.
using PosePath = SharedSequence<Pose2, PathBounds>;

// Calls visit(index, T_map_robot) in order for the poses before `end` that may be within `distance_m` of `p`: for all
// that are, and for some others.
template <typename Visitor>
void ForEachNear(const PosePath& path, std::size_t end, const Eigen::Vector2d& p, double distance_m,
                 const Visitor& visit) {
  path.ForEach(
      end, [&](const PathBounds& bounds) { return bounds.IsWithin(distance_m, p); }, visit);
}

}  // namespace cairn::slam
