// A drive twice round a block, and the comparison of two maps, for tests of the mapper. Frame `world`, whose origin is
// where the robot starts.
#pragma once

#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "server/slam/grid/occupancy_grid.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam::test {

// A ring corridor around a block: driving round it once closes a loop.
inline World Ring() {
  World world = Room(-2, -2, 16, 12);
  world.Add({{2, 2}, {10, 2}, {10, 6}, {2, 6}, {2, 2}});
  world.Add({{5, -2}, {5, -1.5}, {6, -1.5}, {6, -2}}).Add({{14, 3}, {13.4, 3}, {13.4, 4.2}, {14, 4.2}});
  return world;
}

struct Drive {
  std::vector<std::shared_ptr<const Scan>> scans;
  std::vector<Pose2> odometry;
  std::vector<Pose2> truth;
};

// Some times round the ring, with odometry that turns 1 % too far and scales 2 %.
inline Drive DriveRound(int rounds = 2) {
  Drive drive;
  std::mt19937_64 rng(3);
  const Laser laser{.beams = 181, .step_rad = Radians(1.5), .sigma_m = 0.01};
  Pose2 truth{0, 0, 0}, odometry{5, 5, 1};
  const auto step = [&](const Pose2& T_prev_curr) {
    Scan scan = Look(Ring(), truth, laser, &rng);
    scan.stamp = static_cast<Stamp>(drive.scans.size() + 1) * 100'000'000;
    drive.scans.push_back(std::make_shared<const Scan>(std::move(scan)));
    drive.odometry.push_back(odometry);
    drive.truth.push_back(truth);
    truth = truth * T_prev_curr;
    odometry = odometry * Pose2{1.02 * T_prev_curr.x, 0.0, 1.01 * T_prev_curr.theta};
  };
  for (int round = 0; round < rounds; ++round) {
    for (const double side : {12.0, 8.0, 12.0, 8.0}) {
      for (int i = 0; i < static_cast<int>(side / 0.2); ++i) step({0.2, 0, 0});
      for (int i = 0; i < 10; ++i) step({0, 0, kPi / 20});
    }
  }
  return drive;
}

// The share of the occupied cells of `grid` that have no occupied cell of `other` beside them.
inline double ShareMissing(const OccupancyGrid& grid, const OccupancyGrid& other) {
  const double cell_m = grid.options().resolution_m;
  const auto occupied = [](const OccupancyGrid& in, double x, double y) {
    const std::uint8_t cell = in.OccupancyAt({x, y});
    return cell != kUnknownCell && cell > 65;
  };
  int all = 0, missing = 0;
  for (double x = -5.0; x < 45.0; x += cell_m) {
    for (double y = -5.0; y < 25.0; y += cell_m) {
      if (!occupied(grid, x, y)) continue;
      bool near = false;
      for (int i = -3; i <= 3; ++i)
        for (int j = -3; j <= 3; ++j) near = near || occupied(other, x + i * cell_m, y + j * cell_m);
      ++all;
      missing += near ? 0 : 1;
    }
  }
  return static_cast<double>(missing) / all;
}

}  // namespace cairn::slam::test
