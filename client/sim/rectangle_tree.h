// The nearest rectangle along a ray, or to a point, among many: a tree of boxes. Exact: the answer is the same as
// that of trying every rectangle. Frame: `map`, metres. Immutable after construction: thread-safe.
// Source: bounding volume hierarchy with median splits (Kay, Kajiya, SIGGRAPH 1986: slabs).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "client/sim/ray_caster.h"

namespace cairn::sim {

// A flat rectangle in space: what three-dimensional worlds are made of. Both sides stop a ray.
// Frame: `map`, metres, z up. Plain value; functions are exact up to rounding and stateless.
// Source: thesis C 4.3.1 (4.38)-(4.39): a rectangle by its points; 4.3.2 (4.40)-(4.41): where a ray meets its plane.
struct Rectangle {
  Eigen::Vector3d corner_map = Eigen::Vector3d::Zero();
  Eigen::Vector3d side_a = Eigen::Vector3d::UnitX();  // From the corner along two sides, at right angles.
  Eigen::Vector3d side_b = Eigen::Vector3d::UnitY();

  [[nodiscard]] Eigen::Vector3d normal() const;  // Has length 1.
};

// Distance along the ray (`direction` of length 1) to the rectangle; kNothingHit if it misses, runs alongside or
// lies behind. The rim counts as hit: rectangles that share an edge leave no gap.
[[nodiscard]] double CastAtRectangle(const Rectangle& rectangle, const Eigen::Vector3d& origin_map,
                                     const Eigen::Vector3d& direction);

// Distance from a point to the nearest point of the rectangle.
[[nodiscard]] double DistanceTo(const Rectangle& rectangle, const Eigen::Vector3d& p_map);

class RectangleTree {
 public:
  explicit RectangleTree(std::vector<Rectangle> rectangles);

  // Distance to the nearest rectangle within `max_m`, else kNothingHit. `direction` has length 1.
  [[nodiscard]] double Cast(const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction, double max_m) const;

  // Distance from a point to the nearest rectangle; kNothingHit if there is none.
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
  // The least distance of any rectangle. `at_least` gives a lower bound for all rectangles in a box.
  template <typename BoxDistance, typename RectangleDistance>
  [[nodiscard]] double Nearest(const BoxDistance& at_least, const RectangleDistance& distance) const;

  std::vector<Rectangle> rectangles_;
  std::vector<Node> nodes_;
};

}  // namespace cairn::sim
