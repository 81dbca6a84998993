#include "server/slam/grid/disagreement.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

TEST(Disagreement, IsZeroOnTheMapAndTheSquaredOffsetBesideIt) {
  Scan wall;
  wall.angle_first_rad = 0.0;
  wall.angle_step_rad = 0.01;
  wall.range_max_m = 10.0;
  for (int i = 0; i < 21; ++i) {
    const double bearing = wall.angle_first_rad + i * wall.angle_step_rad;
    wall.ranges_m.push_back(static_cast<float>(2.025 / std::cos(bearing)));
  }
  OccupancyGrid grid{GridOptions{}};
  for (int i = 0; i < 5; ++i) grid.Draw(wall, {});
  Disagreement exact;
  exact.Add(wall, {}, grid);
  EXPECT_EQ(exact.mean_m2(), 0.0);
  Disagreement beside;
  beside.Add(wall, {0.10, 0, 0}, grid);
  EXPECT_NEAR(beside.mean_m2(), 0.01, 1e-9);
  Disagreement far;
  far.Add(wall, {2.0, 0, 0}, grid);
  EXPECT_NEAR(far.mean_m2(), Disagreement::kMaxDistanceM * Disagreement::kMaxDistanceM, 1e-12);
}

}  // namespace
}  // namespace cairn::slam
