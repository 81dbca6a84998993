// A simulated building in space: rectangles, and routes for robots on its floor at z = 0. Frame: `map`, metres, z up.
// Plain value. Shapes are functions that add the rectangles they consist of.
// Source: thesis C 4.3.1: walls, doors, windows, floors, ceilings and curved walls all from rectangles.
#pragma once

#include <string>
#include <vector>

#include "client/sim/rectangle_tree.h"
#include "client/sim/world.h"

namespace cairn::sim {

struct World3 {
  std::string name;
  std::vector<Rectangle> rectangles;
  std::vector<Route> routes;
};

// A horizontal rectangle: floor, ceiling, table top.
[[nodiscard]] Rectangle Slab(const Eigen::Vector2d& from_map, const Eigen::Vector2d& to_map, double height_m);

// A box that stands on a turned rectangle: six rectangles.
struct Box {
  Eigen::Vector2d center_map = Eigen::Vector2d::Zero();
  Eigen::Vector2d size_m = Eigen::Vector2d::Ones();  // Along its own x and y.
  double turn_rad = 0.0;
  double bottom_m = 0.0;
  double top_m = 1.0;
};
void AppendBox(const Box& box, std::vector<Rectangle>* rectangles);

// A door (from the wall's bottom) or a window: a hole right through a wall.
struct Opening {
  double from_m = 0.0;  // Along the centre line, from its first end.
  double to_m = 0.0;
  double bottom_m = 0.0;
  double top_m = 2.0;
};

// An upright wall around a centre line, as thick walls of flat worlds (world.h): it reaches half a thickness beyond
// both ends. Openings are in order, apart and inside the wall.
struct Wall3 {
  Eigen::Vector2d a_map = Eigen::Vector2d::Zero();
  Eigen::Vector2d b_map = Eigen::Vector2d::UnitX();
  double thickness_m = 0.12;
  double bottom_m = 0.0;
  double top_m = 2.6;
  std::vector<Opening> openings;
};
void AppendWall(const Wall3& wall, std::vector<Rectangle>* rectangles);

// A prism of `sides` upright faces around a circle, for pillars and round walls. Its corners lie on the circle.
struct Pillar {
  Eigen::Vector2d center_map = Eigen::Vector2d::Zero();
  double radius_m = 0.3;
  double bottom_m = 0.0;
  double top_m = 2.6;
  int sides = 12;
};
void AppendPillar(const Pillar& pillar, std::vector<Rectangle>* rectangles);

}  // namespace cairn::sim
