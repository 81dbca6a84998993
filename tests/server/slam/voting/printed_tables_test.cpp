// The sub-tables of the seven criteria as thesis A prints them, for the scans of its Figures 3.15 and 3.16:
// criteria 6 and 7 are computed from the printed patterns, the others (which need the scans) are taken as
// printed; together they must give the votes of Table 3.24 to its pairs, and criteria 6 and 7 must select
// their pairs without the others. The matching tables have 9 rows for the previous scan and 8 columns for the
// current one, and pair row p with column p - 1; so "previous" in Tables 3.13 and 3.19, with 8 lines, is the
// current scan of Tables 3.4 to 3.24.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "server/slam/voting/criteria.h"
#include "server/slam/voting/pair_selection.h"
#include "tests/server/slam/voting/printed_patterns.h"

namespace cairn::slam {
namespace {

constexpr int kRows = 9, kColumns = 8;
using Printed = std::vector<std::vector<double>>;

const Printed kTable36{{-40, -40, -40, -40, -40, -40, -40, -40}, {1, 1, -40, -40, 1, -40, -40, -40},
                       {1, 1, -40, -40, 1, -40, -40, -40},       {-40, -40, 1, 1, -40, 1, -40, -40},
                       {-40, -40, 1, 1, -40, 1, -40, -40},       {1, 1, -40, -40, 1, -40, -40, -40},
                       {-40, -40, 1, 1, -40, 1, -40, -40},       {-40, -40, -40, -40, -40, -40, 1, 1},
                       {-40, -40, -40, -40, -40, -40, 1, 1}};
const Printed kTable38{{}, {}, {0, 5, 0, 0, 5}, {0, 0, 5, 0, 0, 5}, {0, 0, 0, 5}, {0, 5, 0, 0, 10}, {0, 0, 5, 0, 0, 5},
                       {}, {}};
const Printed kTable39{{0, 3},
                       {64},
                       {0, 58},
                       {0, 0, 3},
                       {0, 0, 0, 20},
                       {0, 0, 0, 0, 46},
                       {0, 0, 0, 0, 0, 17, 0, 3},
                       {0, 0, 0, 0, 0, 0, 50},
                       {0, 0, 0, 0, 0, 0, 0, 50}};
const std::vector<double> kDiagonal324{79, 94, 39, 58, 100, 45, 57, 51};
// The implemented criterion 7 continues to the last corners, where the thesis prints fewer votes or none
// (Table 3.23).
const std::vector<double> kMoreThanPrinted{0, 0, 0, 0, 0, 8, 20, 0};
const std::vector<double> kDiagonal317{6, 10, 14, 16, 17, 14, 6, 0}, kDiagonal323{8, 12, 16, 16, 16, 8, 0, 0};

double At(const Printed& table, int row, int column) {
  const auto& cells = table[static_cast<std::size_t>(row)];
  return static_cast<std::size_t>(column) < cells.size() ? cells[static_cast<std::size_t>(column)] : 0.0;
}

ScanFeatures FeaturesOf(const std::vector<std::vector<double>>& angles,
                        const std::vector<std::vector<double>>& distances, int lines) {
  ScanFeatures features;
  for (int row = 0; row < lines; ++row) {
    LinePattern pattern;
    pattern.angle.fill(std::numeric_limits<double>::quiet_NaN());
    pattern.corner_distance.fill(std::numeric_limits<double>::quiet_NaN());
    pattern.count = std::min(kPatternSize, lines - 1 - row);
    const auto at = static_cast<std::size_t>(row);
    for (std::size_t k = 0; k < static_cast<std::size_t>(pattern.count); ++k) {
      if (k < angles[at].size()) pattern.angle[k] = Radians(angles[at][k]);
      if (at < distances.size() && k < distances[at].size()) pattern.corner_distance[k] = distances[at][k];
    }
    // The first of the following lines that is not parallel to it.
    for (std::size_t k = 0; k < angles[at].size() && pattern.corner_with < 0; ++k)
      if (std::abs(std::sin(Radians(angles[at][k]))) > 0.5) pattern.corner_with = row + 1 + static_cast<int>(k);
    features.patterns.push_back(pattern);
    features.lines.emplace_back();
  }
  return features;
}

class PrintedTables : public testing::Test {
 protected:
  PrintedTables() {
    for (int p = 0; p < kRows; ++p)
      for (int c = 0; c < kColumns; ++c)
        if (At(kTable36, p, c) > 0) candidates_.Add(p, c);
  }
  [[nodiscard]] VoteTable Angles() const {
    VoteTable votes(kRows, kColumns);
    VoteByAnglePatterns({prev_, curr_, candidates_}, {}, votes);
    return votes;
  }
  [[nodiscard]] VoteTable Distances() const {
    VoteTable votes(kRows, kColumns);
    VoteByDistancePatterns({prev_, curr_, candidates_}, {}, votes);
    return votes;
  }
  // As in the thesis, nearly all votes of a criterion lie on the pairs of Table 3.24.
  static void ExpectOnThePairs(const VoteTable& votes, const std::vector<double>& printed) {
    double on = 0.0, off = 0.0;
    for (int p = 0; p < kRows; ++p) {
      for (int c = 0; c < kColumns; ++c) {
        (p == c + 1 ? on : off) += votes.At(p, c);
        if (p == c + 1 && printed[static_cast<std::size_t>(c)] >= 8) {
          EXPECT_GT(votes.At(p, c), 0.0) << p + 1 << ", " << c + 1;
        }
      }
    }
    EXPECT_LT(off, 0.15 * on);  // The printed votes: 18 beside 83, and none beside 76.
  }

  ScanFeatures prev_ = FeaturesOf(test::kCurrAngles, test::kCurrDistances, kRows);
  ScanFeatures curr_ = FeaturesOf(test::kPrevAngles, test::kPrevDistances, kColumns);
  CandidateTable candidates_{kRows, kColumns};
};

TEST_F(PrintedTables, Criterion6VotesForThePairsOfTable317) {
  ExpectOnThePairs(Angles(), kDiagonal317);
}

TEST_F(PrintedTables, Criterion7VotesForThePairsOfTable323) {
  const VoteTable votes = Distances();
  ExpectOnThePairs(votes, kDiagonal323);
  for (int p = 0; p < kRows; ++p)
    for (int c = 0; c < kColumns; ++c)
      if (p != c + 1) {
        EXPECT_EQ(votes.At(p, c), 0.0);
      }
}

TEST_F(PrintedTables, TheSumSelectsThePairsOfTable324WithItsVotes) {
  const VoteWeightOptions weights;
  VoteTable sum(kRows, kColumns);
  for (int p = 0; p < kRows; ++p)
    for (int c = 0; c < kColumns; ++c) sum.At(p, c) = At(kTable36, p, c) + At(kTable38, p, c) + At(kTable39, p, c);
  sum.At(2, 1) += 8;  // Table 3.7.
  sum.At(5, 4) += 8;  // Table 3.11.
  sum.AddWeighted(Angles(), weights.angle_patterns);
  sum.AddWeighted(Distances(), weights.distance_patterns);
  const std::vector<LinePair> pairs = SelectPairs(sum, SelectionOptions{}.min_votes, false);
  ASSERT_EQ(pairs.size(), 8U);
  for (const LinePair& pair : pairs) {
    EXPECT_EQ(pair.ref, pair.curr + 1);
    const auto curr = static_cast<std::size_t>(pair.curr);
    EXPECT_NEAR(pair.votes, kDiagonal324[curr] + kMoreThanPrinted[curr], 6.0) << pair.curr + 1;
  }
}

// The pairs of Table 3.24 have enough votes from the other criteria, so the sum alone would not show that
// criteria 6 and 7 are missing.
TEST_F(PrintedTables, Criteria6And7EachSelectPairsOfTable324WithoutTheOthers) {
  const VoteWeightOptions weights;
  for (const bool angles : {true, false}) {
    VoteTable votes(kRows, kColumns);
    for (int p = 0; p < kRows; ++p)
      for (int c = 0; c < kColumns; ++c) votes.At(p, c) = At(kTable36, p, c);
    votes.AddWeighted(angles ? Angles() : Distances(), angles ? weights.angle_patterns : weights.distance_patterns);
    std::vector<int> selected;
    for (const LinePair& pair : SelectPairs(votes, SelectionOptions{}.min_votes, false)) {
      EXPECT_EQ(pair.ref, pair.curr + 1);
      selected.push_back(pair.curr + 1);
    }
    EXPECT_EQ(selected, angles ? std::vector<int>({3, 4, 5, 6, 7}) : std::vector<int>({1, 2, 3, 4, 5, 6, 7}));
  }
}

}  // namespace
}  // namespace cairn::slam
