#include "server/slam/voting/pair_selection.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

VoteTable TableOf(const std::vector<std::vector<double>>& rows) {
  VoteTable table(static_cast<int>(rows.size()), static_cast<int>(rows.front().size()));
  for (int i = 0; i < table.rows(); ++i) {
    for (int j = 0; j < table.columns(); ++j) {
      table.At(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    }
  }
  return table;
}

const std::vector<std::vector<double>> kTable34{
    {-40, -40, -40, -40, -40, -40, -40, -40}, {79, 1, -40, -40, 3, -40, -40, -40},
    {1, 94, -40, -40, 6, -40, -40, -40},      {-40, -40, 39, 4, -40, 6, -40, -40},
    {-40, -40, 1, 58, -40, 3, -40, -40},      {1, 6, -40, -40, 100, -40, -40, -40},
    {-40, -40, 6, 1, -40, 45, -40, -40},      {-40, -40, -40, -40, -40, -40, 57, 1},
    {-40, -40, -40, -40, -40, -40, 3, 51}};

TEST(PairSelection, Table34BecomesTable35) {
  const std::vector<LinePair> pairs = SelectPairs(TableOf(kTable34), 8.0, false);
  ASSERT_EQ(pairs.size(), 8U);
  const std::vector<double> votes{79, 94, 39, 58, 100, 45, 57, 51};
  for (int k = 0; k < 8; ++k) {
    EXPECT_EQ(pairs[static_cast<std::size_t>(k)].ref, k + 1);
    EXPECT_EQ(pairs[static_cast<std::size_t>(k)].curr, k);
    EXPECT_EQ(pairs[static_cast<std::size_t>(k)].votes, votes[static_cast<std::size_t>(k)]);
  }
}

TEST(PairSelection, TransposedTablesGiveTransposedPairs) {
  VoteTable table = TableOf(kTable34), transposed(table.columns(), table.rows());
  table.At(3, 4) = 42;  // With a conflict.
  for (int i = 0; i < table.rows(); ++i) {
    for (int j = 0; j < table.columns(); ++j) transposed.At(j, i) = table.At(i, j);
  }
  const auto pairs = SelectPairs(table, 8.0, false);
  auto others = SelectPairs(transposed, 8.0, false);
  std::sort(others.begin(), others.end(), [](const LinePair& a, const LinePair& b) { return a.curr < b.curr; });
  ASSERT_EQ(pairs.size(), others.size());
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    EXPECT_EQ(pairs[k].ref, others[k].curr);
    EXPECT_EQ(pairs[k].curr, others[k].ref);
  }
}

// The note under Table 3.24: the largest vote of row 4 is 42 in column 5, which belongs to row 6; the 39 of
// column 3 lies on the line through the other maxima and is taken.
TEST(PairSelection, AConflictGoesToTheCellNearTheRunOfMaxima) {
  VoteTable table = TableOf(kTable34);
  table.At(3, 4) = 42;
  const auto pairs = SelectPairs(table, 8.0, false);
  ASSERT_EQ(pairs.size(), 8U);
  EXPECT_EQ(pairs[2].ref, 3);
  EXPECT_EQ(pairs[2].curr, 2);
}

TEST(PairSelection, NothingBelowTheThreshold) {
  EXPECT_TRUE(SelectPairs(TableOf({{7.9, 1}, {1, 7}}), 8.0, false).empty());
  EXPECT_TRUE(SelectPairs(VoteTable(0, 0), 8.0, false).empty());
  EXPECT_TRUE(SelectPairs(VoteTable(3, 0), 8.0, true).empty());
}

TEST(PairSelection, EveryLineIsTakenAtMostOnce) {
  const auto pairs = SelectPairs(TableOf({{20, 30, 10}, {25, 28, 9}, {12, 11, 8}}), 8.0, false);
  std::vector<int> rows(3, 0), columns(3, 0);
  for (const LinePair& pair : pairs)
    ++rows[static_cast<std::size_t>(pair.ref)], ++columns[static_cast<std::size_t>(pair.curr)];
  for (int i = 0; i < 3; ++i) {
    EXPECT_LE(rows[static_cast<std::size_t>(i)], 1);
    EXPECT_LE(columns[static_cast<std::size_t>(i)], 1);
  }
}

}  // namespace
}  // namespace cairn::slam
