#include "server/slam/matchers/correlative.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/slam/matchers/correlative_search.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

std::vector<SurfacePoint> See(const test::World& world, const Pose2& pose, const test::Laser& laser = {}) {
  const Scan scan = test::Look(world, pose, laser);
  return SurfacePointsOf(PointsOf(scan), scan, SurfaceOptions{});
}

const MatchPrior kPrior{{}, Eigen::Vector3d(0.09, 0.09, 0.04).asDiagonal()};

TEST(LikelihoodTable, TheCoarseTableBoundsTheFineOne) {
  constexpr int kBlock = 6;
  const LikelihoodTable table(See(test::Office(), {}), 0.05, 0.15, 10.0, 0.5, kBlock);
  ASSERT_GT(table.columns(), 20);
  const auto at = [&](const std::vector<std::uint8_t>& values, int x, int y) {
    return values[static_cast<std::size_t>(y * table.columns() + x)];
  };
  for (int y = 0; y + kBlock < table.rows(); y += 5) {
    for (int x = 0; x + kBlock < table.columns(); x += 5) {
      std::uint8_t most = 0;
      for (int dy = 0; dy < kBlock; ++dy)
        for (int dx = 0; dx < kBlock; ++dx) most = std::max(most, at(table.fine(), x + dx, y + dy));
      ASSERT_EQ(at(table.coarse(), x, y), most);
    }
  }
}

TEST(LikelihoodTable, HitsAndTheWallBetweenThemAreCertain) {
  std::vector<SurfacePoint> wall{{{3, 0}, {-1, 0}}, {{3, 0.5}, {-1, 0}}, {{3, 2.5}, {-1, 0}}};
  const LikelihoodTable table(wall, 0.05, 0.15, 10.0, 0.5, 4);
  const auto at = [&](double x, double y) {
    const Eigen::Vector2i cell = table.CellOf({x, y});
    return table.fine()[static_cast<std::size_t>(cell.y() * table.columns() + cell.x())];
  };
  EXPECT_EQ(at(3.0, 0.0), 255);
  EXPECT_EQ(at(3.0, 0.26), 255);
  EXPECT_EQ(at(3.0, 1.5), 0);  // The points are too far apart to be joined.
  EXPECT_GT(at(3.07, 0.0), 100);
  EXPECT_EQ(at(3.3, 0.0), 0);
}

TEST(Correlative, PruningLosesNothing) {
  const Pose2 motion{0.21, -0.13, 0.11};
  const auto prev = See(test::Office(), {}), curr = See(test::Office(), motion);
  CorrelativeOptions options;
  options.window_m = 0.3;
  options.window_rad = 0.2;
  const auto pruned = CorrelativeSearch(prev, curr, kPrior, options).Run(SerialFor);
  options.likely = 1e6;  // So large that nothing is left out as unlikely.
  const auto all = CorrelativeSearch(prev, curr, kPrior, options).Run(SerialFor);
  EXPECT_EQ(pruned.best, all.best);
  EXPECT_LT((pruned.mean.vector() - all.mean.vector()).norm(), 2e-3);
  EXPECT_LT((pruned.covariance - all.covariance).norm(), 0.1 * all.covariance.norm());
  std::printf("tried %d of %d motions\n", pruned.tried, all.tried);
  EXPECT_LT(pruned.tried, all.tried / 4);
}

TEST(Correlative, TheSpreadShowsWhatTheScanLeavesOpen) {
  test::World corridor;
  corridor.Add({{-50, 1}, {50, 1}}).Add({{-50, -1}, {50, -1}});
  test::Laser laser;
  laser.range_max_m = 5.0;
  const auto answer =
      CorrelativeSearch(See(corridor, {}, laser), See(corridor, {0.2, 0, 0}, laser), kPrior, {}).Run(SerialFor);
  EXPECT_GT(answer.covariance(0, 0), 20.0 * answer.covariance(1, 1));
}

TEST(Correlative, AnAnswerAtTheBorderIsNone) {
  CorrelativeOptions options;
  options.window_m = 0.1;
  const ScanView prev{{}, See(test::Office(), {})}, curr{{}, See(test::Office(), {0.3, 0, 0})};
  const MatchResult match = MatchByCorrelation(prev, curr, kPrior, options, SerialFor);
  EXPECT_FALSE(match.converged);
  EXPECT_EQ(match.failure, MatchFailure::kNotConverged);
  EXPECT_EQ(match.T_ref_curr, kPrior.T_ref_curr);
}

}  // namespace
}  // namespace cairn::slam
