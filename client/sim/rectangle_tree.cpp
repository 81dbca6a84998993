#include "client/sim/rectangle_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace cairn::sim {
namespace {

constexpr std::int32_t kLeafSize = 4;
constexpr double kMargin_m = 1e-6;     // Boxes of flat rectangles have no thickness of their own.
constexpr std::size_t kMaxDepth = 64;  // Median splits: 2^31 rectangles would be 30 deep.

Eigen::AlignedBox3d BoxOf(const Rectangle& r) {
  Eigen::AlignedBox3d box(r.corner_map);
  box.extend(r.corner_map + r.side_a).extend(r.corner_map + r.side_b).extend(r.corner_map + r.side_a + r.side_b);
  return box;
}

// The distance at which the ray enters the box (0 if it starts inside); more than `max_m` where it misses.
double Enter(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
             double max_m) {
  double enter = 0.0, leave = max_m;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction(axis) == 0.0) {
      if (origin(axis) < box.min()(axis) || origin(axis) > box.max()(axis)) return kNothingHit;
      continue;
    }
    const double a = (box.min()(axis) - origin(axis)) / direction(axis);
    const double b = (box.max()(axis) - origin(axis)) / direction(axis);
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave ? enter : kNothingHit;
}

}  // namespace

Eigen::Vector3d Rectangle::normal() const {
  return side_a.cross(side_b).normalized();
}

double CastAtRectangle(const Rectangle& rectangle, const Eigen::Vector3d& origin_map,
                       const Eigen::Vector3d& direction) {
  constexpr double kRim_m = 1e-9;
  const Eigen::Vector3d normal = rectangle.normal();
  const double approach = normal.dot(direction);
  if (std::abs(approach) < 1e-12) return kNothingHit;
  const double range = normal.dot(rectangle.corner_map - origin_map) / approach;
  if (!(range > 0.0)) return kNothingHit;
  const Eigen::Vector3d p = origin_map + range * direction - rectangle.corner_map;
  const double a = rectangle.side_a.norm(), b = rectangle.side_b.norm();
  const double u = p.dot(rectangle.side_a) / a, v = p.dot(rectangle.side_b) / b;
  const bool inside = u >= -kRim_m && u <= a + kRim_m && v >= -kRim_m && v <= b + kRim_m;
  return inside ? range : kNothingHit;
}

double DistanceTo(const Rectangle& rectangle, const Eigen::Vector3d& p_map) {
  const Eigen::Vector3d p = p_map - rectangle.corner_map;
  const double u = std::clamp(p.dot(rectangle.side_a) / rectangle.side_a.squaredNorm(), 0.0, 1.0);
  const double v = std::clamp(p.dot(rectangle.side_b) / rectangle.side_b.squaredNorm(), 0.0, 1.0);
  return (p - u * rectangle.side_a - v * rectangle.side_b).norm();
}

RectangleTree::RectangleTree(std::vector<Rectangle> rectangles) : rectangles_(std::move(rectangles)) {
  if (!rectangles_.empty()) Build(0, static_cast<std::int32_t>(rectangles_.size()));
}

void RectangleTree::Build(std::int32_t begin, std::int32_t end) {
  const std::size_t index = nodes_.size();
  nodes_.push_back({{}, 0, begin, end});
  Eigen::AlignedBox3d box, centers;
  for (std::int32_t i = begin; i < end; ++i) {
    const Eigen::AlignedBox3d own = BoxOf(rectangles_[static_cast<std::size_t>(i)]);
    box.extend(own);
    centers.extend(own.center());
  }
  nodes_[index].box = {box.min().array() - kMargin_m, box.max().array() + kMargin_m};
  if (end - begin <= kLeafSize) return;
  Eigen::Index axis = 0;
  centers.sizes().maxCoeff(&axis);
  const std::int32_t middle = begin + (end - begin) / 2;
  std::nth_element(
      rectangles_.begin() + begin, rectangles_.begin() + middle, rectangles_.begin() + end,
      [axis](const Rectangle& a, const Rectangle& b) { return BoxOf(a).center()(axis) < BoxOf(b).center()(axis); });
  Build(begin, middle);
  nodes_[index].right = static_cast<std::int32_t>(nodes_.size());
  Build(middle, end);
}

template <typename BoxDistance, typename RectangleDistance>
double RectangleTree::Nearest(const BoxDistance& at_least, const RectangleDistance& distance) const {
  double nearest = kNothingHit;
  if (nodes_.empty()) return nearest;
  std::array<std::int32_t, kMaxDepth> stack;
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const std::int32_t index = stack[--depth];
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    const double least = at_least(node.box);
    if (least == kNothingHit || least > nearest) continue;
    if (node.right > 0) {
      stack[depth++] = node.right;
      stack[depth++] = index + 1;
      continue;
    }
    for (std::int32_t i = node.begin; i < node.end; ++i)
      nearest = std::min(nearest, distance(rectangles_[static_cast<std::size_t>(i)]));
  }
  return nearest;
}

double RectangleTree::Cast(const Eigen::Vector3d& origin_map, const Eigen::Vector3d& direction, double max_m) const {
  const double nearest =
      Nearest([&](const Eigen::AlignedBox3d& box) { return Enter(box, origin_map, direction, max_m); },
              [&](const Rectangle& rectangle) { return CastAtRectangle(rectangle, origin_map, direction); });
  return nearest <= max_m ? nearest : kNothingHit;
}

double RectangleTree::Distance(const Eigen::Vector3d& p_map) const {
  return Nearest([&](const Eigen::AlignedBox3d& box) { return box.exteriorDistance(p_map); },
                 [&](const Rectangle& rectangle) { return DistanceTo(rectangle, p_map); });
}

}  // namespace cairn::sim
