#include "server/slam/grid/disagreement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

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

// A wall slantwise through four chunks, seen from both sides of their borders, against a search through all cells.
TEST(Disagreement, CountsTheDistanceToTheNearestOccupiedCellOfAnyChunk) {
  Scan wall;
  wall.angle_first_rad = -1.0;
  wall.angle_step_rad = 0.05;
  wall.range_max_m = 10.0;
  for (int i = 0; i < 41; ++i) wall.ranges_m.push_back(2.0F + 0.03F * static_cast<float>(i % 7));
  OccupancyGrid grid{GridOptions{}};
  for (int i = 0; i < 5; ++i) grid.Draw(wall, {4.5, -0.3, 0.4});
  const double cell_m = grid.options().resolution_m;
  for (const Pose2& pose : {Pose2{4.5, -0.3, 0.4}, Pose2{4.6, -0.2, 0.42}, Pose2{4.4, -0.45, 0.3}}) {
    double sum_m2 = 0.0;
    for (std::size_t i = 0; i < wall.ranges_m.size(); ++i) {
      const double bearing = wall.angle_first_rad + static_cast<double>(i) * wall.angle_step_rad;
      const GridCell end =
          CellOf(pose * (static_cast<double>(wall.ranges_m[i]) * Eigen::Vector2d(std::cos(bearing), std::sin(bearing))),
                 cell_m);
      double nearest_m2 = Disagreement::kMaxDistanceM * Disagreement::kMaxDistanceM;
      for (int y = -8; y <= 8; ++y) {
        for (int x = -8; x <= 8; ++x) {
          const Eigen::Vector2d p_map = cell_m * Eigen::Vector2d(end.x + x + 0.5, end.y + y + 0.5);
          const std::uint8_t occupancy = grid.OccupancyAt(p_map);
          if (occupancy != kUnknownCell && occupancy > 50)
            nearest_m2 = std::min(nearest_m2, (x * x + y * y) * cell_m * cell_m);
        }
      }
      sum_m2 += nearest_m2;
    }
    Disagreement disagreement;
    disagreement.Add(wall, pose, grid);
    EXPECT_NEAR(disagreement.mean_m2(), sum_m2 / static_cast<double>(wall.ranges_m.size()), 1e-12);
    EXPECT_LT(disagreement.mean_m2(), 0.5 * Disagreement::kMaxDistanceM * Disagreement::kMaxDistanceM);
  }
}

}  // namespace
}  // namespace cairn::slam
