// A large loop for tests: a corridor round a block, and the steps of a robot that drives round it. Frame
// `world`, whose origin is one corner of the corridor's centre line; the robot starts there, heading along x.
#pragma once

#include <random>
#include <vector>

#include "tests/server/slam/worlds.h"

namespace cairn::slam::test {

// A corridor 2 m wide round a block of 36 x 16 m. Niches of any width, drawn with `seed`, make no two
// stretches alike, unless left out.
inline World RingCorridor(bool niches, std::uint64_t seed = 11) {
  World world;
  std::mt19937_64 rng(seed);
  std::uniform_real_distribution<double> any(0.0, 1.0);
  const auto side = [&](Eigen::Vector2d from, const Eigen::Vector2d& to, const Eigen::Vector2d& outward) {
    const Eigen::Vector2d along = (to - from).normalized();
    while (niches && (to - from).norm() > 5.0) {
      const Eigen::Vector2d a = from + along * (1.0 + 2.0 * any(rng)), b = a + along * (0.6 + 1.2 * any(rng));
      const Eigen::Vector2d depth = outward * (0.3 + 0.5 * any(rng));
      world.Add({from, a, a + depth, b + depth, b});
      from = b;
    }
    world.Add({from, to});
  };
  side({-1, -1}, {39, -1}, {0, -1}), side({39, -1}, {39, 19}, {1, 0});
  side({39, 19}, {-1, 19}, {0, 1}), side({-1, 19}, {-1, -1}, {-1, 0});
  world.Add({{1, 1}, {37, 1}, {37, 17}, {1, 17}, {1, 1}});
  return world;
}

// The same corridor with a room behind a door every 4 m of its outer side, all of them equal: along a side
// every place looks like the place 4 m further on.
inline World RingOfEqualRooms() {
  World world = RingCorridor(false);
  world.walls.erase(world.walls.begin(), world.walls.begin() + 4);  // The outer side.
  const auto side = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& along, double length_m) {
    const Eigen::Vector2d outward(along.y(), -along.x());
    const auto at = [&](double x, double y) -> Eigen::Vector2d { return from + along * x + outward * y; };
    for (double x = 0.0; x < length_m - 1e-9; x += 4.0)
      world.Add({at(x, 0), at(x + 1.4, 0), at(x + 1.4, 0.2), at(x + 0.2, 0.2), at(x + 0.2, 2.6), at(x + 3.8, 2.6),
                 at(x + 3.8, 0.2), at(x + 2.6, 0.2), at(x + 2.6, 0), at(x + 4.0, 0)});
  };
  side({-1, -1}, {1, 0}, 40.0), side({39, -1}, {0, 1}, 20.0);
  side({39, 19}, {-1, 0}, 40.0), side({-1, 19}, {0, -1}, 20.0);
  return world;
}

// `metres` along the centre line, anticlockwise, turning on the spot at the corners.
inline std::vector<Pose2> RingSteps(double metres, double step_m) {
  std::vector<Pose2> steps;
  double to_corner_m = 38.0;
  bool long_side = true;
  for (double way_m = 0.0; way_m < metres; way_m += step_m) {
    steps.push_back({step_m, 0, 0});
    to_corner_m -= step_m;
    if (to_corner_m > step_m / 2) continue;
    for (int i = 0; i < 5; ++i) steps.push_back({0, 0, kPi / 10});
    long_side = !long_side;
    to_corner_m = long_side ? 38.0 : 18.0;
  }
  return steps;
}

}  // namespace cairn::slam::test
