// Finds the poses of a path that are nearest to a position, in a time that hardly grows with the length of the path:
// where a robot drives past the same places for a day, most poses are near and few of them are the nearest. It follows
// the path of a filter's best hypothesis, which is another one from step to step: the last poses of the path, in which
// hypotheses differ, are looked through as ForEachNear does, and only those before them are in the index. Positions in
// the frame of the path. Not thread-safe.
// Source: a quadtree (Finkel and Bentley 1974), searched from the nearest part on (Hjaltason and Samet 1999).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/slam/trail/pose_path.h"

namespace cairn::slam {

class PathIndex {
 public:
  // From now on it finds the poses of `path`. Takes the time of the indexed poses that are other than before.
  void Follow(const PosePath& path);
  [[nodiscard]] const PosePath& path() const { return path_; }

  // Calls visit(index, pose) for all poses that are within `most_m` of `p`, and for some others; the order is not that
  // of the path. Asks go_on(distance_m) from time to time, where no pose that is nearer than `distance_m` remains to be
  // visited, and ends if the answer is false.
  template <typename GoOn, typename Visitor>
  void ForEachFrom(const Eigen::Vector2d& p, double most_m, const GoOn& go_on, const Visitor& visit) const;

  // How many poses are in the index.
  [[nodiscard]] std::size_t indexed() const { return indexed_; }

 private:
  static constexpr double kRoundingM = 1e-6;   // More than the rounding of a distance.
  static constexpr std::size_t kLast = 1024;   // Poses at the end of the path, at least, that are not in the index.
  static constexpr std::size_t kAtOnce = 256;  // So many are put into it together.
  static constexpr std::size_t kMostInLeaf = 16;
  static constexpr double kLeastHalfM = 1.0 / 1024.0;  // A square of this half width is not divided further.
  static constexpr double kFarM = 1e9;                 // No robot gets there; such poses are not in the tree.

  struct Square {
    double x = 0.0, y = 0.0;  // The centre.
    double half_m = 64.0;

    [[nodiscard]] bool Contains(const Pose2& pose) const {
      return std::abs(pose.x - x) <= half_m && std::abs(pose.y - y) <= half_m;
    }
    [[nodiscard]] int QuarterOf(const Pose2& pose) const { return (pose.x < x ? 0 : 1) + (pose.y < y ? 0 : 2); }
    [[nodiscard]] Square Quarter(int number) const {
      const double half = 0.5 * half_m;
      return {(number & 1) != 0 ? x + half : x - half, (number & 2) != 0 ? y + half : y - half, half};
    }
    [[nodiscard]] double DistanceM(const Eigen::Vector2d& p) const {
      return std::hypot(std::max(std::abs(p.x() - x) - half_m, 0.0), std::max(std::abs(p.y() - y) - half_m, 0.0));
    }
  };
  struct Node {
    std::uint32_t quarters = 0;        // The first of the four nodes below; 0 for a leaf.
    std::vector<std::uint32_t> poses;  // Of a leaf, in the order of the path.
  };
  struct Reached {
    double distance_m = 0.0;
    std::uint32_t node = 0;
    Square square;
    bool operator<(const Reached& other) const { return distance_m > other.distance_m; }  // The nearest is the largest.
  };

  void Insert(std::size_t index);
  void Divide(std::uint32_t node, const Square& square);
  void RemoveLast();
  void Grow(const Pose2& pose);
  static bool IsFar(const Pose2& pose) { return !(std::abs(pose.x) < kFarM && std::abs(pose.y) < kFarM); }

  PosePath path_;
  std::size_t indexed_ = 0;
  Square square_;  // Of the root, which is the first node.
  std::vector<Node> nodes_{1};
  std::vector<std::uint32_t> far_;        // Of the indexed poses, those that are not in the tree.
  mutable std::vector<Reached> reached_;  // Scratch memory.
};

template <typename GoOn, typename Visitor>
void PathIndex::ForEachFrom(const Eigen::Vector2d& p, double most_m, const GoOn& go_on, const Visitor& visit) const {
  const auto near = [&](const PathBounds& bounds) { return bounds.IsWithin(most_m, p); };
  path_.ForEach(indexed_, path_.size(), near, visit);
  for (const std::uint32_t index : far_) visit(index, path_[index]);
  reached_.assign(1, {square_.DistanceM(p), 0, square_});
  while (!reached_.empty()) {
    std::pop_heap(reached_.begin(), reached_.end());
    const Reached next = reached_.back();
    reached_.pop_back();
    const double least_m = std::max(0.0, next.distance_m - kRoundingM);
    if (least_m > most_m || !go_on(least_m)) return;
    const Node& node = nodes_[next.node];
    if (node.quarters == 0) {
      for (const std::uint32_t index : node.poses) visit(index, path_[index]);
      continue;
    }
    for (int i = 0; i < 4; ++i) {
      const std::uint32_t below = node.quarters + static_cast<std::uint32_t>(i);
      if (nodes_[below].quarters == 0 && nodes_[below].poses.empty()) continue;
      const Square quarter = next.square.Quarter(i);
      reached_.push_back({quarter.DistanceM(p), below, quarter});
      std::push_heap(reached_.begin(), reached_.end());
    }
  }
}

}  // namespace cairn::slam
