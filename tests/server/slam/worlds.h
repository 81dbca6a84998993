// Small worlds of straight walls, and a laser that measures them exactly, for tests of slam. Frame `world`;
// metres and radians. There is noise only if a random engine is passed in.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"

namespace cairn::slam::test {

struct World {
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> walls;

  // A chain of walls through the points.
  World& Add(const std::vector<Eigen::Vector2d>& points) {
    for (std::size_t i = 0; i + 1 < points.size(); ++i) walls.emplace_back(points[i], points[i + 1]);
    return *this;
  }
};

// Walls of a rectangle with its lower left corner at (x, y).
inline World Room(double x, double y, double width, double height) {
  World world;
  world.Add({{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}, {x, y}});
  return world;
}

// A room with niches and a box: no two walls alike, so that there is one right answer.
inline World Office() {
  World world;
  world.Add({{-3, -2.2},
             {4, -2.2},
             {4, 0.3},
             {5.1, 0.3},
             {5.1, 1.7},
             {4, 1.7},
             {4, 3.1},
             {1.2, 3.1},
             {1.2, 4.0},
             {-0.4, 4.0},
             {-0.4, 3.1},
             {-3, 3.1},
             {-3, -2.2}});
  world.Add({{2.2, -1.2}, {3.0, -0.9}, {2.8, -0.35}, {2.0, -0.65}, {2.2, -1.2}});
  return world;
}

struct Laser {
  int beams = 181;
  double first_rad = -kPi / 2;
  double step_rad = Radians(1.0);
  double range_max_m = 30.0;
  double sigma_m = 0.0;  // Standard deviation of the ranges, used if an engine is given.
  Pose2 T_robot_laser = {};
};

inline Laser FullTurnLaser(int beams = 360) {
  return {.beams = beams, .first_rad = -kPi, .step_rad = 2.0 * kPi / beams};
}

// Distance from `from` along `direction` (unit) to the nearest wall; infinite where there is none.
inline double RayLength(const World& world, const Eigen::Vector2d& from, const Eigen::Vector2d& direction) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [a, b] : world.walls) {
    const Eigen::Vector2d wall = b - a, to_a = a - from;
    const double cross = direction.x() * wall.y() - direction.y() * wall.x();
    if (std::abs(cross) < 1e-12) continue;
    const double along_ray = (to_a.x() * wall.y() - to_a.y() * wall.x()) / cross;
    const double along_wall = (to_a.x() * direction.y() - to_a.y() * direction.x()) / cross;
    if (along_ray > 1e-9 && along_wall >= -1e-12 && along_wall <= 1.0 + 1e-12) nearest = std::min(nearest, along_ray);
  }
  return nearest;
}

inline Scan Look(const World& world, const Pose2& T_world_robot, const Laser& laser,
                 std::mt19937_64* engine = nullptr) {
  Scan scan;
  scan.angle_first_rad = laser.first_rad;
  scan.angle_step_rad = laser.step_rad;
  scan.range_min_m = 0.02;
  scan.range_max_m = laser.range_max_m;
  scan.T_robot_laser = laser.T_robot_laser;
  const Pose2 T_world_laser = T_world_robot * laser.T_robot_laser;
  // The distribution requires a value above 0 even if it is not used.
  std::normal_distribution<double> noise(0.0, std::max(laser.sigma_m, 1e-12));
  for (int beam = 0; beam < laser.beams; ++beam) {
    const double angle = T_world_laser.theta + laser.first_rad + beam * laser.step_rad;
    double range = RayLength(world, T_world_laser.translation(), {std::cos(angle), std::sin(angle)});
    if (engine != nullptr && laser.sigma_m > 0.0) range += noise(*engine);
    scan.ranges_m.push_back(range >= laser.range_max_m ? std::numeric_limits<float>::infinity()
                                                       : static_cast<float>(range));
  }
  return scan;
}

}  // namespace cairn::slam::test
