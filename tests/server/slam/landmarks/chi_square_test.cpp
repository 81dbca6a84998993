#include <gtest/gtest.h>

#include "server/slam/filters/filter.h"
#include "server/slam/landmarks/innovation.h"

namespace cairn::slam {
namespace {

TEST(ChiSquareQuantile, MatchesTheTables) {  // Abramowitz and Stegun 1964, Table 26.8.
  EXPECT_NEAR(ChiSquareQuantile(0.95, 1), 3.84146, 1e-4);
  EXPECT_NEAR(ChiSquareQuantile(0.95, 2), 5.99146, 1e-4);
  EXPECT_NEAR(ChiSquareQuantile(0.975, 3), 9.34840, 1e-4);
  EXPECT_NEAR(ChiSquareQuantile(0.025, 10), 3.24697, 1e-4);
  EXPECT_NEAR(ChiSquareQuantile(0.025, 100), 74.2219, 1e-3);
  EXPECT_NEAR(ChiSquareQuantile(0.975, 100), 129.561, 1e-3);
}

TEST(ChiSquareQuantile, UndoesTheShareAlsoForManyNumbers) {
  for (const double numbers : {1.0, 7.0, 300.0, 30000.0})
    for (const double share : {0.025, 0.5, 0.975})
      EXPECT_NEAR(ChiSquareShare(ChiSquareQuantile(share, numbers), numbers), share, 1e-6);
}

// Sixteen served for two and for three numbers.
TEST(MaxNis, IsTheSameQuantileForAnyNumbers) {
  const double share = ChiSquareShare(kMaxNis<3>, 3);
  EXPECT_NEAR(kMaxNis<2>, ChiSquareQuantile(share, 2), 1e-3);
  EXPECT_NEAR(kMaxNis<1>, ChiSquareQuantile(share, 1), 1e-3);
}

TEST(ChiSquareShare, IsNothingBelowNothing) {
  EXPECT_EQ(ChiSquareShare(0.0, 3), 0.0);
  EXPECT_EQ(ChiSquareShare(-1.0, 3), 0.0);
  EXPECT_NEAR(ChiSquareShare(1e9, 3), 1.0, 1e-12);
}

}  // namespace
}  // namespace cairn::slam
