// A simulated place that can be scanned from anywhere, with and without noise, and the walls that a scan
// shows. For studies of single scans and pairs of scans; drives are in logs.h. Immutable: thread-safe.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "client/sim/laser.h"
#include "client/sim/random.h"
#include "client/sim/ray_caster.h"
#include "client/sim/world.h"
#include "tests/flat_world.h"

namespace cairn::studies {

// What a noise-free scan shows of one straight wall.
struct VisibleWall {
  Eigen::Vector2d a_robot;  // The ends of the visible part, in sweep order.
  Eigen::Vector2d b_robot;
  int hits = 0;
  [[nodiscard]] double length() const { return (b_robot - a_robot).norm(); }
};

class Scene {
 public:
  // A shipped world's name, a world file, or (with a line break in it) the text of one. Throws
  // std::invalid_argument.
  explicit Scene(const std::string& world);

  [[nodiscard]] const std::string& name() const { return world_.name; }

  // A random pose on a route, up to `aside_m` beside it, with any heading; at least 0.35 m from walls.
  [[nodiscard]] Pose2 DrawPose(sim::Random& random, double aside_m = 0.3) const;
  [[nodiscard]] double Clearance(const Pose2& T_map_robot) const {
    return sim::DistanceToWalls(world_.segments, T_map_robot.translation());
  }

  // `moved`: discs that are in this scan in addition to those of the world.
  [[nodiscard]] Scan Look(const Pose2& T_map_robot, const sim::LaserOptions& laser, sim::Random& random,
                          std::span<const sim::Disc> moved = {}) const;

  // The walls that a perfect laser like this one hits, however small the visible part is.
  [[nodiscard]] std::vector<VisibleWall> VisibleWalls(const Pose2& T_map_robot, const sim::LaserOptions& laser) const;

 private:
  sim::World world_;
  sim::RayCaster walls_;
};

// A SICK LMS 200 as in the theses: 180 degrees in 1 degree steps, in the robot's middle.
[[nodiscard]] sim::LaserOptions Sick(double noise_m);

}  // namespace cairn::studies
