// The printed tables of thesis A as oracles for the overlap measures.
#include "server/slam/matching/overlap.h"

#include <gtest/gtest.h>

#include <limits>

#include "common/geometry/angle.h"

namespace cairn::slam {
namespace {

using Rows = std::vector<std::vector<double>>;

// Table 3.13 and Table 3.14, degrees; printed zeros at the ends of rows are blanks.
const Rows kPrevAngles{{1.4085, -87.9693, -88.4311, 2.3449, -89.4927},
                       {-89.3777, -89.8395, .9365, -90.9011, -180.3647},
                       {-.4618, 90.3142, -1.5234, -90.9870, -91.8016},
                       {90.7760, -1.0616, -90.5252, -91.3399},
                       {-91.8376, -181.3012, -182.1158},
                       {-89.4636, -90.2783},
                       {-.8147},
                       {}};
const Rows kCurrAngles{{-91.7365, -90.5958, -181.5675, -181.1587, -89.4536},
                       {1.1407, -89.8309, -89.4221, 2.2829, -90.5593},
                       {-90.9717, -90.5629, 1.1422, -91.7001, -182.5422},
                       {.4088, 92.1138, -.7284, -91.5705, -89.9596},
                       {91.7050, -1.1372, -91.9794, -90.3684},
                       {-92.8423, -183.6844, -182.0734},
                       {-90.8421, -89.2312},
                       {1.6110},
                       {}};

// Table 3.19 and Table 3.20; printed 100 and 200 are blanks.
const Rows kPrevDistances{{.4144, 2.7908, 2.9215, 1.9227, 2.7909},
                          {2.3765, 2.5273, 1.5083, 2.3765},
                          {.8832, .8690, .0453},
                          {1.2123, .8379},
                          {.8682},
                          {},
                          {}};
const Rows kCurrDistances{{3.7364, 3.4230, 2.4693, 1.6257, 2.6171},
                          {.4338, 2.8394, 2.9506, 1.9395, 2.8394},
                          {2.4056, 2.5380, 1.5057, 2.4056},
                          {.8435, .8999, .0015},
                          {1.2254, .8451},
                          {.8999},
                          {}};

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
      // The printed 1 cannot be twice anything.
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
  EXPECT_EQ(OverlapTypeOf(line, Along(-0.2, -1, 1)), OverlapType::kBeforeFirst);  // Whichever way the other runs.
}

}  // namespace
}  // namespace cairn::slam
