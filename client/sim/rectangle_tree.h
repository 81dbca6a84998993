// The nearest rectangle along a ray, or to a point, among many: a tree of boxes. Exact: the answer is the same as
// that of trying every rectangle. Frame: `map`, metres. Immutable after construction: thread-safe.
// Source: bounding volume hierarchy with median splits (Kay, Kajiya, SIGGRAPH 1986: slabs).
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "client/sim/rectangle.h"

namespace cairn::sim {

class RectangleTree {
 public:
  explicit RectangleTree(std::vector<Rectangle> rectangles);

  // Distance to the nearest rectangle within `max_m`, else kNothingHit. `direction` has length 1.
  [[nodiscard]] double Cast(const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction, double max_m) const;

  // Distance from a point to the nearest rectangle; kNothingHit where there is none.
  [[nodiscard]] double Distance(const Eigen::Vector3d& p_map) const;

  [[nodiscard]] const std::vector<Rectangle>& rectangles() const { return rectangles_; }

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    std::int32_t right = 0;  // Inner nodes: the second child; the first follows its parent. Leaves: 0.
    std::int32_t begin = 0;  // Leaves: rectangles [begin, end).
    std::int32_t end = 0;
  };
  void Build(std::int32_t begin, std::int32_t end);

  std::vector<Rectangle> rectangles_;
  std::vector<Node> nodes_;
};

}  // namespace cairn::sim
