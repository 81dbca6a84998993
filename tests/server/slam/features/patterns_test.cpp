#include <gtest/gtest.h>

#include "server/slam/features/corners.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

constexpr double kCrossing = Radians(25.0);

// A line from a to b.
LineFeature Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  LineFeature line;
  line.first = a, line.last = b;
  line.length = (b - a).norm();
  line.slope = std::atan2(b.y() - a.y(), b.x() - a.x());
  return line;
}

// Lines at arbitrary places with the given differences of slope from the first.
std::vector<LineFeature> LinesWithSlopes(const std::vector<double>& degrees) {
  std::vector<LineFeature> lines;
  for (std::size_t i = 0; i < degrees.size(); ++i) {
    const Eigen::Vector2d at(0.7 * static_cast<double>(i), 0.3 * static_cast<double>(i * i)),
        along(std::cos(Radians(degrees[i])), std::sin(Radians(degrees[i])));
    lines.push_back(Line(at, at + along));
  }
  return lines;
}

TEST(Patterns, AnglesAreSlopeDifferencesToTheFollowingFive) {
  const auto patterns = PatternsOf(LinesWithSlopes({0, 90, 180, -90, 45, 10, 20}), false, kCrossing);
  ASSERT_EQ(patterns.size(), 7U);
  EXPECT_EQ(patterns[0].count, 5);
  EXPECT_NEAR(patterns[0].angle[0], Radians(-90), 1e-9);
  EXPECT_NEAR(std::abs(patterns[0].angle[1]), kPi, 1e-9);
  EXPECT_NEAR(patterns[0].angle[2], Radians(90), 1e-9);
  EXPECT_EQ(patterns[4].count, 2);
  EXPECT_NEAR(patterns[4].angle[0], Radians(35), 1e-9);
  EXPECT_TRUE(std::isnan(patterns[4].angle[2]));
  EXPECT_EQ(patterns[6].count, 0);
}

// The slopes of Tables 3.13 and 3.14 (first column summed up): which lines have corners decides how many
// entries each row of Tables 3.19 and 3.20 has.
TEST(Patterns, PrintedSlopesGiveCornerTablesOfThePrintedShape) {
  const auto entries = [](const LinePattern& pattern) {
    int count = 0;
    for (int j = 0; j < pattern.count; ++j)
      count += std::isnan(pattern.corner_distance[static_cast<std::size_t>(j)]) ? 0 : 1;
    return count;
  };
  const auto slopes = [](const std::vector<double>& steps) {
    std::vector<double> sums{0.0};
    for (const double step : steps) sums.push_back(sums.back() - step);
    return sums;
  };
  const auto prev = PatternsOf(LinesWithSlopes(slopes({1.4085, -89.3777, -.4618, 90.7760, -91.8376, -89.4636, -.8147})),
                               false, kCrossing);
  const std::vector<int> printed_prev{5, 4, 3, 2, 1, 0, 0, 0};  // Table 3.19 has rows 1 to 6.
  for (std::size_t i = 0; i < prev.size(); ++i) EXPECT_EQ(entries(prev[i]), printed_prev[i]) << i;
  const auto curr =
      PatternsOf(LinesWithSlopes(slopes({-91.7365, 1.1407, -90.9717, .4088, 91.7050, -92.8423, -90.8421, 1.6110})),
                 false, kCrossing);
  const std::vector<int> printed_curr{5, 5, 4, 3, 2, 1, 0, 0, 0};  // Table 3.20 has rows 1 to 7.
  for (std::size_t i = 0; i < curr.size(); ++i) EXPECT_EQ(entries(curr[i]), printed_curr[i]) << i;
}

TEST(Patterns, DistancesAreBetweenTheCornersOfTheLines) {
  const std::vector<LineFeature> lines{Line({0, 0}, {2, 0}), Line({3, 1}, {3, 2}), Line({2, 4}, {1, 4}),
                                       Line({0, 3}, {0, 1})};
  const auto patterns = PatternsOf(lines, false, kCrossing);
  EXPECT_EQ(patterns[0].corner_with, 1);
  EXPECT_NEAR(patterns[0].corner_distance[0], 4.0, 1e-9);  // (3, 0) to (3, 4).
  EXPECT_NEAR(patterns[0].corner_distance[1], 5.0, 1e-9);  // (3, 0) to (0, 4).
  EXPECT_TRUE(std::isnan(patterns[0].corner_distance[2]));
  EXPECT_EQ(patterns[3].corner_with, -1);
}

TEST(Patterns, GoRoundInAFullTurn) {
  const std::vector<LineFeature> lines{Line({0, 0}, {2, 0}), Line({3, 1}, {3, 2}), Line({2, 4}, {1, 4}),
                                       Line({0, 3}, {0, 1})};
  const auto patterns = PatternsOf(lines, true, kCrossing);
  for (const LinePattern& pattern : patterns) EXPECT_EQ(pattern.count, 3);
  EXPECT_EQ(patterns[3].corner_with, 0);
  EXPECT_NEAR(patterns[3].corner_distance[0], 3.0, 1e-9);  // (0, 0) to (3, 0).
  EXPECT_NEAR(patterns[3].angle[0], Radians(-90), 1e-9);
}

TEST(Patterns, NoLinesGiveNoPatterns) {
  EXPECT_TRUE(PatternsOf({}, true, kCrossing).empty());
  const auto one = PatternsOf(LinesWithSlopes({30}), true, kCrossing);
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0].count, 0);
}

}  // namespace
}  // namespace cairn::slam
