// A simulated log whose odometry errs exactly as a given model says: the truth of every step is drawn from Eliazar's
// model at the step the odometry reports. The robot steers by its true pose, so it stays on its route.
#pragma once

#include <algorithm>
#include <cmath>
#include <ostream>
#include <stdexcept>

#include "client/sim/laser.h"
#include "client/sim/shipped_worlds.h"
#include "common/sensor/carmen_writer.h"
#include "common/sensor/trajectory.h"
#include "server/slam/motion_models/eliazar_model.h"
#include "tests/flat_world.h"

namespace cairn::server::test {

struct NoisyDrive {
  std::string world = "building";
  slam::EliazarModel model{};
  sim::LaserOptions laser{};
  int steps = 500;
  std::uint64_t seed = 1;
};

// Writes the log; answers the true poses at its scans.
inline Trajectory WriteNoisyDrive(const NoisyDrive& drive, std::ostream& log) {
  auto world = sim::OpenWorld(drive.world);
  if (!world || world->routes.empty()) throw std::invalid_argument("NoisyDrive: no such world, or no route in it");
  const std::vector<Eigen::Vector2d>& route = world->routes.front().waypoints_map;
  const sim::RayCaster walls(world->segments);
  std::mt19937_64 engine(drive.seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  CarmenWriter writer(log);
  const Eigen::Vector2d first = route[1] - route[0];
  Pose2 truth{route[0].x(), route[0].y(), std::atan2(first.y(), first.x())}, T_odom_robot;
  Trajectory path;
  std::size_t target = 1;
  for (int i = 0; i <= drive.steps; ++i) {
    const Stamp stamp = (i + 1) * (kNanosPerSecond / 2);
    path.push_back({stamp, truth});
    writer.Write(Odometry{0, stamp, T_odom_robot});
    writer.Write(sim::MeasureFlatScan(walls, world->discs, truth, {}, stamp, drive.laser, engine), T_odom_robot);
    Eigen::Vector2d way = route[target] - truth.translation();
    if (way.norm() < 0.4) {
      target = (target + 1) % route.size();
      way = route[target] - truth.translation();
    }
    const double off = AngleDiff(std::atan2(way.y(), way.x()), truth.theta);
    // Just above the gate of 0.25 m and 0.2 rad, so that every scan ends a step.
    slam::OdometryStep step{0.26 + 0.1 * uniform(engine), std::clamp(off, -0.15, 0.15)};
    if (std::abs(off) > 0.4) step = {0.02, std::copysign(0.21 + 0.2 * uniform(engine), off)};
    T_odom_robot = T_odom_robot * slam::MotionOf({step.d, 0.0, step.b});
    truth = truth * slam::SampleMotion(drive.model, step, engine);
  }
  return path;
}

}  // namespace cairn::server::test
