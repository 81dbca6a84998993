#include "server/slam/calibration/square_run.h"

#include <algorithm>
#include <cmath>

#include "server/slam/random/draws.h"

namespace cairn::slam {

void Visit(OptionVisitor& visitor, SquareRunOptions& options) {
  visitor.Real("E_d", options.errors.E_d, "1", 0.9, 1.1,
               "True diameter of the right wheel divided by that of the left one.");
  visitor.Real("E_b", options.errors.E_b, "1", 0.9, 1.1,
               "True wheel base divided by the one that the odometry assumes.");
  visitor.Real("slip_m_per_sqrt_m", options.slip_m_per_sqrt_m, "m", 0.0, 0.1,
               "Standard deviation of the way of a wheel after 1 m.");
  visitor.Integer("bumps", options.bumps, "1", 0, 1000, "Number of bumps along the square, under the inner wheel.");
  visitor.Real("bump_m", options.bump_m, "m", 0.0, 0.1, "Way that a bump takes from a wheel.");
}

SquareRun SimulateSquareRun(bool clockwise, const SquareRunOptions& run, const UmbmarkOptions& square,
                            std::mt19937_64& engine) {
  // Slip bends the path at every point, so the run is simulated in short steps.
  constexpr double kStep_m = 0.05;
  constexpr double kStep_rad = 0.05;
  const double base = square.drive.base_m;
  const double left = 2.0 / (run.errors.E_d + 1.0), right = 2.0 / (1.0 / run.errors.E_d + 1.0);
  SquareRun result{clockwise, {}, {}};
  const auto drive = [&](double way, double turn, double inner_bump) {
    const WheelTravel believed = TravelOfArc(way, turn, base);
    WheelTravel travel{believed.left_m * left, believed.right_m * right};
    travel.left_m += run.slip_m_per_sqrt_m * std::sqrt(std::abs(travel.left_m)) * NormalDraw(engine);
    travel.right_m += run.slip_m_per_sqrt_m * std::sqrt(std::abs(travel.right_m)) * NormalDraw(engine);
    (clockwise ? travel.right_m : travel.left_m) -= inner_bump;
    result.measured = result.measured * MotionOfTravel(travel, base * run.errors.E_b);
    result.calculated = result.calculated * MotionOfTravel(believed, base);
  };
  const int steps = std::max(1, static_cast<int>(std::ceil(square.side_m / kStep_m)));
  const int turns = std::max(1, static_cast<int>(std::ceil(kPi / 2 / kStep_rad)));
  std::int64_t passed = 0;
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < steps; ++i) {
      // The k-th of n bumps lies at the share (k + 1/2) / n of the path.
      const std::int64_t reached = (2 * run.bumps * (side * steps + i + 1) + 4 * steps) / (8 * steps);
      drive(square.side_m / steps, 0.0, static_cast<double>(reached - passed) * run.bump_m);
      passed = reached;
    }
    for (int i = 0; i < turns; ++i) drive(0.0, (clockwise ? -kPi / 2 : kPi / 2) / turns, 0.0);
  }
  return result;
}

}  // namespace cairn::slam
