#include "server/slam/dpslam/opacity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/server/slam/dpslam/textbook_opacity.h"

namespace cairn::slam {
namespace {

TEST(Opacity, ALaserIsStoppedOnceInAMeanFreePath) {
  EXPECT_NEAR(StopProbability(0.05, 0.05), 1.0 - std::exp(-1.0), 1e-12);
  EXPECT_NEAR(StopProbability(0.05, 5.0), 0.00995017, 1e-8);
  EXPECT_EQ(StopProbability(0.0, 0.05), 0.0);
}

// Two halves of a way through a cell stop as many rays as the whole. So the model does not depend on how a
// ray cuts a cell.
TEST(Opacity, AWayMayBeCutAnywhere) {
  const std::vector<RaySpan> cut{{0.02, 0.4, 0.0}, {0.03, 0.4, 0.0}};
  EXPECT_NEAR(StoppedProbability(cut), StopProbability(0.05, 0.4), 1e-12);
}

TEST(Opacity, ThirdCellIsReachedThroughTheFirstTwo) {  // Thesis C, Figure 3.7.
  const std::vector<RaySpan> spans{{0.05, 1.0, 0.0}, {0.06, 0.5, 0.0}, {0.04, 0.1, 0.0}};
  EXPECT_NEAR(StopProbabilityAt(spans, 2), (1.0 - std::exp(-0.4)) * std::exp(-0.05) * std::exp(-0.12), 1e-12);
}

TEST(Opacity, StopsAddUpToNotHavingPassed) {  // (3.36) telescopes.
  std::vector<RaySpan> spans;
  double depth = 0.0;
  for (int i = 0; i < 50; ++i) {
    spans.push_back({0.01 + 0.001 * i, 0.3 + 0.05 * (i % 7), 0.0});
    depth += spans.back().length_m / spans.back().opacity_m;
  }
  EXPECT_NEAR(StoppedProbability(spans), 1.0 - std::exp(-depth), 1e-12);
}

// Over all ranges that a laser may report, the density of a ray sums to the probability that it was stopped
// at all.
TEST(Opacity, DensityOverAllRangesIsTheChanceToBeStopped) {
  std::vector<RaySpan> spans;
  for (int i = 0; i < 40; ++i) spans.push_back({0.05, i == 30 ? 0.02 : 2.0, 0.0});
  const double step = 0.002;
  double sum = 0.0;
  for (double range = -1.0; range < 4.0; range += step) {
    for (std::size_t i = 0; i < spans.size(); ++i) spans[i].delta_m = range - (0.05 * static_cast<double>(i) + 0.025);
    sum += step * RayDensity(spans, 0.05);
  }
  EXPECT_NEAR(sum, StoppedProbability(spans), 1e-6);
}

TEST(Opacity, RateIsStopsPerTravelWithThePriorsRatioWhereUnseen) {
  OpacityOptions options;
  options.resolution_m = 0.05;
  options.prior_stops = 0.02;
  options.prior_distance_m = 0.10;
  const StopRate rate(options);
  EXPECT_FLOAT_EQ(rate({0, 0}), 0.01F);  // 0.02 stops in 2 cells.
  // 3 stops in 32 / 32 + 2 cells.
  EXPECT_FLOAT_EQ(rate({32, 3}), 3.02F / 3.0F);
  EXPECT_LT(rate({3200, 0}), rate({32, 0}));
}

}  // namespace
}  // namespace cairn::slam
