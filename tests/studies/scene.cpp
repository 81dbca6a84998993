#include "tests/studies/scene.h"

#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <utility>

#include "client/sim/shipped_worlds.h"
#include "client/sim/world.h"
#include "client/sim/world_file.h"
#include "tests/flat_world.h"

namespace cairn::studies {
namespace {

sim::World OpenOrThrow(const std::string& world) {
  auto opened =
      world.find('\n') == std::string::npos ? sim::OpenWorld(world) : sim::ParseWorld(world, "a study's world");
  if (!opened) throw std::invalid_argument(opened.error().message);
  if (opened->routes.empty()) throw std::invalid_argument("the world " + world + " has no route");
  return *std::move(opened);
}

// How far a point is from the infinite line and along the segment (0..1).
std::pair<double, double> PlaceOn(const sim::Segment& segment, const Eigen::Vector2d& p) {
  const Eigen::Vector2d along = segment.b_map - segment.a_map, off = p - segment.a_map;
  const double length = along.norm();
  return {std::abs(along.x() * off.y() - along.y() * off.x()) / length, along.dot(off) / (length * length)};
}

}  // namespace

Scene::Scene(const std::string& world) : world_(OpenOrThrow(world)), walls_(world_.segments) {}

Pose2 Scene::DrawPose(sim::Random& random, double aside_m) const {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int attempt = 0; attempt < 10000; ++attempt) {
    const auto index = static_cast<std::size_t>(unit(random) * static_cast<double>(world_.routes.size()));
    const auto& waypoints = world_.routes[std::min(index, world_.routes.size() - 1)].waypoints_map;
    const sim::PathPlace place = sim::PlaceOnPath(waypoints, unit(random) * sim::ClosedLength(waypoints));
    const Pose2 pose{place.p_map.x() + aside_m * (2 * unit(random) - 1),
                     place.p_map.y() + aside_m * (2 * unit(random) - 1), WrapAngle(2 * kPi * unit(random))};
    if (Clearance(pose) >= 0.35) return pose;
  }
  throw std::invalid_argument("the routes of " + world_.name + " keep no distance from its walls");
}

Scan Scene::Look(const Pose2& T_map_robot, const sim::LaserOptions& laser, sim::Random& random,
                 std::span<const sim::Disc> moved) const {
  std::vector<sim::Disc> discs = world_.discs;
  discs.insert(discs.end(), moved.begin(), moved.end());
  return sim::MeasureFlatScan(walls_, discs, T_map_robot, {}, 0, laser, random);
}

std::vector<VisibleWall> Scene::VisibleWalls(const Pose2& T_map_robot, const sim::LaserOptions& laser) const {
  sim::LaserOptions perfect = laser;
  perfect.error.sigma_m = perfect.error.sigma_share = perfect.dropout_share = perfect.sweep_s = 0.0;
  sim::Random unused(0);
  const Scan scan = Look(T_map_robot, perfect, unused);
  const Pose2 T_map_laser = T_map_robot * laser.T_robot_laser;
  const Pose2 T_robot_map = T_map_robot.Inverse();
  std::vector<VisibleWall> visible(world_.segments.size());
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
    const double range = scan.ranges_m[beam];
    if (!std::isfinite(range)) continue;
    const double angle = scan.angle_first_rad + static_cast<double>(beam) * scan.angle_step_rad;
    const Eigen::Vector2d p = T_map_laser * Eigen::Vector2d(range * std::cos(angle), range * std::sin(angle));
    std::size_t hit = visible.size();
    double nearest = 1e-4;  // Ranges are single precision.
    for (std::size_t i = 0; i < world_.segments.size(); ++i) {
      const auto [distance, share] = PlaceOn(world_.segments[i], p);
      if (distance >= nearest || share < -1e-6 || share > 1 + 1e-6) continue;
      nearest = distance;
      hit = i;
    }
    if (hit == visible.size()) continue;  // A disc.
    VisibleWall& wall = visible[hit];
    if (wall.hits++ == 0) wall.a_robot = T_robot_map * p;
    wall.b_robot = T_robot_map * p;
  }
  std::erase_if(visible, [](const VisibleWall& wall) { return wall.hits < 2; });
  return visible;
}

sim::LaserOptions Sick(double noise_m) {
  sim::LaserOptions laser;
  laser.beams = 181;
  laser.field_of_view_rad = kPi;
  laser.error.sigma_m = noise_m;
  laser.error.sigma_share = 0.0;
  laser.dropout_share = 0.0;
  laser.T_robot_laser = {};
  return laser;
}

}  // namespace cairn::studies
