#include "tests/studies/thesis_b/known_map.h"

#include <algorithm>
#include <cmath>

#include "server/slam/features/feature_extraction.h"
#include "server/slam/features/polyline.h"
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
bool CanBeSeen(const std::vector<sim::Segment>& outlines, const slam::MapLine& side) {
  const Eigen::Vector2d along = (side.b - side.a).normalized(), left(-along.y(), along.x());
  return std::ranges::any_of(std::initializer_list<double>{0.1, 0.3, 0.5, 0.7, 0.9}, [&](double share) {
    return TurnsRound(outlines, side.a + share * (side.b - side.a) + 0.005 * left) == 0;
  });
}

}  // namespace

std::vector<slam::MapLine> KnownMapOf(const sim::World& world) {
  std::vector<slam::MapLine> map;
  for (const sim::Segment& segment : world.segments)
    for (const slam::MapLine& side :
         {slam::MapLine{segment.a_map, segment.b_map}, slam::MapLine{segment.b_map, segment.a_map}})
      if (CanBeSeen(world.segments, side)) map.push_back(side);
  return map;
}

std::vector<slam::MapLine> KnownMapOf(const std::vector<slam::Keyframe>& keyframes, const std::vector<Pose2>& path) {
  // One wall seen from two keyframes differs by what the path is wrong by.
  slam::PolylineOptions options;
  options.collinear_m = 0.1;
  std::vector<slam::LineFeature> lines;
  for (std::size_t k = 0; k < keyframes.size() && k < path.size(); ++k) {
    for (const slam::LineFeature& line : slam::ExtractFeatures(*keyframes[k].scan, slam::FeatureOptions{}).lines)
      lines.push_back(SeenFrom(line, path[k]));
    lines = slam::MergeCollinear(std::move(lines), options);
  }
  std::ranges::stable_sort(lines, [](const auto& a, const auto& b) { return a.length > b.length; });
  std::vector<slam::MapLine> map;
  for (const slam::LineFeature& line : lines) map.push_back({line.first, line.last});
  return map;
}

std::vector<slam::MapLine> LinesNear(const std::vector<slam::MapLine>& map, const Eigen::Vector2d& p_map,
                                     double reach_m) {
  std::vector<slam::MapLine> near;
  for (const slam::MapLine& line : map) {
    const Eigen::Vector2d way = line.b - line.a;
    const double share = std::clamp(way.dot(p_map - line.a) / way.squaredNorm(), 0.0, 1.0);
    if ((line.a + share * way - p_map).norm() < reach_m) near.push_back(line);
  }
  return near;
}

}  // namespace cairn::studies
