#include "client/sim/world3.h"

#include <cmath>

#include "common/geometry/pose2.h"

namespace cairn::sim {
namespace {

Eigen::Vector3d At(const Eigen::Vector2d& p, double z) {
  return {p.x(), p.y(), z};
}

Rectangle Upright(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double bottom, double top) {
  return {At(a, bottom), At(b - a, 0.0), {0.0, 0.0, top - bottom}};
}

}  // namespace

Rectangle Slab(const Eigen::Vector2d& from_map, const Eigen::Vector2d& to_map, double height_m) {
  return {At(from_map, height_m), {to_map.x() - from_map.x(), 0.0, 0.0}, {0.0, to_map.y() - from_map.y(), 0.0}};
}

void AppendBox(const Box& box, std::vector<Rectangle>* rectangles) {
  const Pose2 T_map_box{box.center_map.x(), box.center_map.y(), WrapAngle(box.turn_rad)};
  const Eigen::Vector2d half = box.size_m / 2;
  const Eigen::Vector2d corners[] = {
      T_map_box * Eigen::Vector2d(-half.x(), -half.y()), T_map_box * Eigen::Vector2d(half.x(), -half.y()),
      T_map_box * Eigen::Vector2d(half.x(), half.y()), T_map_box * Eigen::Vector2d(-half.x(), half.y())};
  for (int i = 0; i < 4; ++i) rectangles->push_back(Upright(corners[i], corners[(i + 1) % 4], box.bottom_m, box.top_m));
  for (const double height : {box.bottom_m, box.top_m})
    rectangles->push_back({At(corners[0], height), At(corners[1] - corners[0], 0.0), At(corners[3] - corners[0], 0.0)});
}

void AppendWall(const Wall3& wall, std::vector<Rectangle>* rectangles) {
  const Eigen::Vector2d along = wall.b_map - wall.a_map;
  const double length = along.norm();
  const Eigen::Vector2d unit = along / length;
  const auto piece = [&](double from, double to, double bottom, double top) {
    if (to <= from || top <= bottom) return;
    AppendBox({wall.a_map + unit * (from + to) / 2,
               {to - from, wall.thickness_m},
               std::atan2(along.y(), along.x()),
               bottom,
               top},
              rectangles);
  };
  double reached = -wall.thickness_m / 2;
  for (const Opening& opening : wall.openings) {
    piece(reached, opening.from_m, wall.bottom_m, wall.top_m);
    piece(opening.from_m, opening.to_m, wall.bottom_m, opening.bottom_m);
    piece(opening.from_m, opening.to_m, opening.top_m, wall.top_m);
    reached = opening.to_m;
  }
  piece(reached, length + wall.thickness_m / 2, wall.bottom_m, wall.top_m);
}

void AppendPillar(const Pillar& pillar, std::vector<Rectangle>* rectangles) {
  const auto corner = [&](int i) {
    const double angle = 2 * kPi * i / pillar.sides;
    return Eigen::Vector2d(pillar.center_map + pillar.radius_m * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  };
  for (int i = 0; i < pillar.sides; ++i)
    rectangles->push_back(Upright(corner(i), corner(i + 1), pillar.bottom_m, pillar.top_m));
}

}  // namespace cairn::sim
