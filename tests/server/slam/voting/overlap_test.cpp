// The printed tables of thesis A as oracles for the overlap measures.
#include <gtest/gtest.h>

#include <limits>

#include "common/geometry/angle.h"
#include "server/slam/voting/criteria.h"
#include "tests/server/slam/voting/printed_patterns.h"

namespace cairn::slam {
namespace {

using test::kCurrAngles, test::kCurrDistances, test::kPrevAngles, test::kPrevDistances;

std::vector<double> Padded(std::vector<double> row, double factor) {
  for (double& value : row) value *= factor;
  row.resize(5, std::numeric_limits<double>::quiet_NaN());
  return row;
}

TEST(PatternOverlap, ReproducesAllOfTable316) {
  const std::vector<std::vector<int>> printed{{2, 5, 2, 2}, {4, 5, 2, 2}, {2, 5, 3, 1}, {4, 4, 1, 2},
                                              {1, 3, 1, 0}, {1, 2, 0, 0}, {0, 1, 0, 0}};
  for (std::size_t row = 0; row < printed.size(); ++row) {
    for (std::size_t shift = 0; shift < 4; ++shift) {
      const std::size_t other = row + shift;
      const int score = other >= kCurrAngles.size()
                            ? 0
                            : PatternOverlap(Padded(kPrevAngles[row], kPi / 180), Padded(kCurrAngles[other], kPi / 180),
                                             Radians(2.65), true);
      EXPECT_EQ(score, printed[row][shift]) << "row " << row + 1 << " column " << shift + 1;
    }
  }
}

TEST(PatternOverlap, TwiceItReproducesTable322ButForOneCell) {
  const std::vector<std::vector<int>> printed{{0, 10, 0, 0, 0}, {0, 8, 0, 0, 0}, {0, 6, 2, 2, 0}, {2, 4, 1, 0, 0},
                                              {2, 2, 0, 0, 0},  {0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}};
  int equal = 0;
  for (std::size_t row = 0; row < printed.size(); ++row) {
    for (std::size_t shift = 0; shift < 5; ++shift) {
      const std::size_t other = row + shift;
      const int score =
          other >= kCurrDistances.size()
              ? 0
              : PatternOverlap(Padded(kPrevDistances[row], 1.0), Padded(kCurrDistances[other], 1.0), 0.05, false);
      equal += 2 * score == printed[row][shift] ? 1 : 0;
      // The printed 1 is odd and cannot be twice an integer.
      if (row == 3 && shift == 2) {
        EXPECT_EQ(score, 0);
      }
    }
  }
  EXPECT_EQ(equal, 34);
}

TEST(PatternOverlap, KeepsTheOrder) {
  const std::vector<double> a{1, 2, 3}, b{3, 2, 1};
  EXPECT_EQ(PatternOverlap(a, a, 0.1, false), 3);
  EXPECT_EQ(PatternOverlap(a, b, 0.1, false), 1);
}

TEST(PatternOverlap, ComparesAnglesAcrossTheWrap) {
  const std::vector<double> a{kPi - 0.01}, b{-kPi + 0.01};
  EXPECT_EQ(PatternOverlap(a, b, 0.03, true), 1);
  EXPECT_EQ(PatternOverlap(a, b, 0.03, false), 0);
}

TEST(PatternOverlap, TellsWhichEntriesAgree) {
  const double blank = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> a{blank, 1, 2}, b{7, 1, blank, 2};
  std::vector<std::pair<int, int>> taken;
  EXPECT_EQ(PatternOverlap(a, b, 0.1, false, &taken), 2);
  EXPECT_EQ(taken, (std::vector<std::pair<int, int>>{{1, 1}, {2, 3}}));
}

LineFeature Along(double from, double to, double y) {
  LineFeature line;
  line.first = {from, y}, line.last = {to, y};
  line.length = std::abs(to - from);
  line.slope = to > from ? 0.0 : kPi;
  return line;
}

TEST(OverlapType, TellsTheThreeCasesOfFigure321) {
  const LineFeature line = Along(0, 2, 0);
  EXPECT_EQ(OverlapTypeOf(line, Along(1, 3, 1)), OverlapType::kOverlap);
  EXPECT_EQ(OverlapTypeOf(line, Along(-1, 3, 1)), OverlapType::kOverlap);
  EXPECT_EQ(OverlapTypeOf(line, Along(0.5, 1.5, 1)), OverlapType::kOverlap);
  EXPECT_EQ(OverlapTypeOf(line, Along(2.5, 3, 1)), OverlapType::kBeyondLast);
  EXPECT_EQ(OverlapTypeOf(line, Along(-1, -0.2, 1)), OverlapType::kBeforeFirst);
  // The direction of the other line does not matter.
  EXPECT_EQ(OverlapTypeOf(line, Along(-0.2, -1, 1)), OverlapType::kBeforeFirst);
}

}  // namespace
}  // namespace cairn::slam
