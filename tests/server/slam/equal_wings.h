// A square of corridors of which two opposite sides, the wings, look exactly alike, and the two between them do not:
// who has seen one wing cannot know which. Frame `world`: the first wing goes from the origin along x, and a robot
// drives anticlockwise round the square, so that the hall follows it, then the second wing.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/server/slam/worlds.h"

namespace cairn::slam::test {

inline World EqualWings(double wing_m, double hall_m) {
  World world;
  // A wall with niches on the side of `outward`, no two alike. The same seed makes the same wall.
  const auto wall = [&](Eigen::Vector2d from, const Eigen::Vector2d& to, const Eigen::Vector2d& outward,
                        std::uint64_t seed) {
    std::mt19937_64 rng(seed);
    std::uniform_real_distribution<double> any(0.0, 1.0);
    const Eigen::Vector2d along = (to - from).normalized();
    while ((to - from).norm() > 5.0) {
      const Eigen::Vector2d a = from + along * (0.5 + 2.0 * any(rng)), b = a + along * (0.6 + 1.6 * any(rng));
      const Eigen::Vector2d depth = outward * (0.5 + 1.5 * any(rng));
      world.Add({from, a, a + depth, b + depth, b});
      from = b;
    }
    world.Add({from, to});
  };
  constexpr std::uint64_t kWing = 11, kHall = 12, kOtherHall = 13, kInside = 100;
  const double x = wing_m, y = hall_m;
  wall({-1, -1}, {x + 1, -1}, {0, -1}, kWing);
  wall({x + 1, -1}, {x + 1, y + 1}, {1, 0}, kHall);
  wall({x + 1, y + 1}, {-1, y + 1}, {0, 1}, kWing);
  wall({-1, y + 1}, {-1, -1}, {-1, 0}, kOtherHall);
  // Round the block in the middle.
  wall({1, 1}, {x - 1, 1}, {0, 1}, kWing + kInside);
  wall({x - 1, 1}, {x - 1, y - 1}, {-1, 0}, kHall + kInside);
  wall({x - 1, y - 1}, {1, y - 1}, {0, -1}, kWing + kInside);
  wall({1, y - 1}, {1, 1}, {1, 0}, kOtherHall + kInside);
  return world;
}

// What a robot is told to drive: steps along its heading, and turns on the spot.
class StepList {
 public:
  explicit StepList(double step_m) : step_m_(step_m) {}
  StepList& Ahead(double way_m) {
    for (double left_m = way_m; left_m > step_m_ / 2; left_m -= step_m_) steps_.push_back({step_m_, 0, 0});
    return *this;
  }
  StepList& Turn(double angle_rad) {
    const int count = static_cast<int>(std::lround(std::abs(angle_rad) / (kPi / 10)));
    for (int i = 0; i < count; ++i) steps_.push_back({0, 0, angle_rad / count});
    return *this;
  }
  [[nodiscard]] const std::vector<Pose2>& steps() const { return steps_; }

 private:
  double step_m_;
  std::vector<Pose2> steps_;
};

}  // namespace cairn::slam::test
