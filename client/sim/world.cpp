#include "client/sim/world.h"

#include <algorithm>
#include <cmath>

namespace cairn::sim {

Disc WalkerAt(const Walker& walker, double seconds) {
  return {PlaceOnPath(walker.path_map, walker.speed_m_s * seconds).p_map, walker.radius_m};
}

bool IsClosed(const Door& door, double seconds) {
  return std::fmod(door.begin_s + seconds, door.closed_s + door.open_s) < door.closed_s;
}

double DistanceFrom(const Door& door, const Eigen::Vector2d& p_map) {
  const Eigen::Vector2d along = door.b_map - door.a_map;
  const double share = std::clamp((p_map - door.a_map).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (door.a_map + share * along - p_map).norm();
}

void AppendLeaf(const Door& door, std::vector<Disc>* discs) {
  constexpr double kRadiusM = 0.04, kApartM = 0.05;
  const int parts = std::max(1, static_cast<int>(std::ceil((door.b_map - door.a_map).norm() / kApartM)));
  for (int i = 0; i <= parts; ++i)
    discs->push_back({door.a_map + static_cast<double>(i) / parts * (door.b_map - door.a_map), kRadiusM});
}

double ClosedLength(const std::vector<Eigen::Vector2d>& points) {
  double length = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) length += (points[(i + 1) % points.size()] - points[i]).norm();
  return length;
}

PathPlace PlaceOnPath(const std::vector<Eigen::Vector2d>& points, double way_m) {
  double left = std::fmod(way_m, ClosedLength(points));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t next = (i + 1) % points.size();
    const Eigen::Vector2d leg = points[next] - points[i];
    const double length = leg.norm();
    if (left < length || i + 1 == points.size()) {
      const Eigen::Vector2d direction = length > 0.0 ? Eigen::Vector2d(leg / length) : Eigen::Vector2d(1.0, 0.0);
      return {points[i] + direction * std::min(left, length), std::atan2(direction.y(), direction.x()), next};
    }
    left -= length;
  }
  return {};
}

void AppendWall(const Wall& wall, std::vector<Segment>* segments) {
  const double length = (wall.b_map - wall.a_map).norm(), half = wall.thickness_m / 2;
  const Eigen::Vector2d along = (wall.b_map - wall.a_map) / length, left(-along.y(), along.x());
  const auto piece = [&](double from, double to) {
    if (to <= from) return;
    const Eigen::Vector2d corners[4] = {wall.a_map + along * from - left * half, wall.a_map + along * to - left * half,
                                        wall.a_map + along * to + left * half, wall.a_map + along * from + left * half};
    for (int i = 0; i < 4; ++i) segments->push_back({corners[i], corners[(i + 1) % 4]});
  };
  double from = -half;
  for (const WallGap& gap : wall.gaps) {
    piece(from, gap.from_m);
    from = gap.to_m;
  }
  piece(from, length + half);
}

}  // namespace cairn::sim
