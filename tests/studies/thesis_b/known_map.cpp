#include "tests/studies/thesis_b/known_map.h"

#include <algorithm>
#include <cmath>

#include "tests/studies/thesis_b/thesis_b.h"

namespace cairn::studies {
namespace {

// How often the outlines go round a point: 0 outside of all walls.
long TurnsRound(const std::vector<sim::Segment>& outlines, const Eigen::Vector2d& p) {
  double turned = 0.0;
  for (const sim::Segment& side : outlines) {
    const Eigen::Vector2d a = side.a_map - p, b = side.b_map - p;
    turned += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
  }
  return std::lround(turned / (2.0 * kPi));
}

// Some part of the side on the left of the way from a to b is outside of all walls.
bool CanBeSeen(const std::vector<sim::Segment>& outlines, const MapLine& side) {
  const Eigen::Vector2d along = (side.b - side.a).normalized(), left(-along.y(), along.x());
  return std::ranges::any_of(std::initializer_list<double>{0.1, 0.3, 0.5, 0.7, 0.9}, [&](double share) {
    return TurnsRound(outlines, side.a + share * (side.b - side.a) + 0.005 * left) == 0;
  });
}

}  // namespace

std::vector<MapLine> KnownMapOf(const sim::World& world) {
  std::vector<MapLine> map;
  for (const sim::Segment& segment : world.segments)
    for (const MapLine& side : {MapLine{segment.a_map, segment.b_map}, MapLine{segment.b_map, segment.a_map}})
      if (CanBeSeen(world.segments, side)) map.push_back(side);
  return map;
}

}  // namespace cairn::studies
