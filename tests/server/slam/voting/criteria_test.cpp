#include "server/slam/voting/criteria.h"

#include <gtest/gtest.h>

#include "server/slam/features/feature_extraction.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

LineFeature Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, EndClass ends = EndClass::kOpen) {
  LineFeature line;
  line.first = a, line.last = b;
  line.length = (b - a).norm();
  line.slope = std::atan2(b.y() - a.y(), b.x() - a.x());
  line.distance = std::abs(line.OffsetOf({0, 0}));
  line.ends = ends;
  return line;
}

// The votes of one criterion if all pairs are candidates.
template <typename Criterion>
VoteTable Votes(const ScanFeatures& prev, const ScanFeatures& curr, const Criterion& criterion) {
  const int rows = static_cast<int>(prev.lines.size()), columns = static_cast<int>(curr.lines.size());
  CandidateTable all(rows, columns);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) all.Add(i, j);
  }
  VoteTable votes(rows, columns);
  criterion(ScanPair{prev, curr, all}, votes);
  return votes;
}

const ToleranceOptions kTolerances;
constexpr double kUnique = 4.0;

TEST(PossibilityVotes, ExcludeWhatTheRobotCannotHaveTurnedOrMoved) {
  ScanFeatures prev, curr;
  prev.lines = {Line({3, -1}, {3, 1})};
  curr.lines = {Line({3, -1}, {3, 1}), Line({1, 2}, {-1, 2}), Line({5, -1}, {5, 1})};
  VoteTable votes(1, 3);
  const CandidateTable candidates = VoteByPossibility(prev, curr, {}, {}, {}, votes);
  EXPECT_TRUE(candidates.Has(0, 0));
  EXPECT_FALSE(candidates.Has(0, 1));  // 90 deg off.
  EXPECT_FALSE(candidates.Has(0, 2));  // 2 m apart.
  EXPECT_DOUBLE_EQ(votes.At(0, 0), 2.0);
  EXPECT_DOUBLE_EQ(votes.At(0, 1), -40.0);
}

TEST(PossibilityVotes, FollowTheOdometry) {
  ScanFeatures prev, curr;
  prev.lines = {Line({3, -1}, {3, 1})};
  curr.lines = {Line({1, 2}, {-1, 2})};
  VoteTable votes(1, 1);
  // Turned by -90 deg: what was ahead is now to the left.
  EXPECT_TRUE(VoteByPossibility(prev, curr, {1, 0, -kPi / 2}, {}, {}, votes).Has(0, 0));
}

TEST(LongLineVotes, GoToTheWallWithoutRival) {
  ScanFeatures prev, curr;
  prev.lines = {Line({-2, -1}, {3, -1}), Line({3, 1}, {-2, 1}), Line({4, -0.5}, {4, 0.5})};
  curr.lines = prev.lines;
  const auto vote = [](const ScanPair& scans, VoteTable& votes) {
    VoteByLongLines(scans, kTolerances, kUnique, votes);
  };
  VoteTable votes = Votes(prev, curr, vote);
  EXPECT_GT(votes.At(0, 0), 0.0);
  EXPECT_EQ(votes.At(2, 2), 0.0);                     // The line is too short.
  curr.lines.push_back(Line({-2, -1.4}, {3, -1.4}));  // A line of equal length, close beside the first.
  votes = Votes(prev, curr, vote);
  EXPECT_EQ(votes.At(0, 0), 0.0);
}

TEST(CornerVotes, NeedEqualAnglesAndCountMoreWhenUnique) {
  ScanFeatures prev, curr;
  prev.lines.resize(4), curr.lines.resize(4);
  const auto corner = [](int a, int b, double degrees, bool real) {
    return CornerFeature{.position = {1, 1}, .real = real, .angle = Radians(degrees), .line_a = a, .line_b = b};
  };
  prev.corners = {corner(0, 1, 90, true), corner(2, 3, -60, true)};
  curr.corners = {corner(0, 1, 92, true), corner(1, 2, 89, true), corner(2, 3, -61, true), corner(0, 3, 90, false)};
  const VoteTable votes = Votes(prev, curr, [](const ScanPair& scans, VoteTable& table) {
    VoteByRealCorners(scans, kTolerances, kUnique, table);
  });
  EXPECT_DOUBLE_EQ(votes.At(0, 0), 1.0);
  EXPECT_DOUBLE_EQ(votes.At(0, 1), 1.0);
  EXPECT_DOUBLE_EQ(votes.At(2, 2), 2.0);  // The only line with this angle.
  EXPECT_DOUBLE_EQ(votes.At(3, 3), 2.0);
  EXPECT_DOUBLE_EQ(votes.At(1, 3), 0.0);  // Virtual corners take no part.
}

TEST(ParallelVotes, NeedEqualDistanceAndCountMoreWhenUniqueAndBesideEachOther) {
  ScanFeatures prev, curr;
  prev.lines = {Line({0, -1}, {4, -1}), Line({4, 1.2}, {0, 1.2}), Line({4, 2.0}, {1, 2.0})};
  curr.lines = {Line({0, -1.1}, {4, -1.1}), Line({4, 1.1}, {0, 1.1})};
  const VoteTable votes = Votes(
      prev, curr, [](const ScanPair& scans, VoteTable& table) { VoteByParallels(scans, kTolerances, kUnique, table); });
  EXPECT_DOUBLE_EQ(votes.At(0, 0), kUnique + 1.0);
  EXPECT_DOUBLE_EQ(votes.At(1, 1), kUnique + 1.0);
  EXPECT_DOUBLE_EQ(votes.At(2, 1), 0.0);
}

TEST(ParallelVotes, TellAWallFromTheSameDistanceOnTheOtherSide) {
  ScanFeatures prev, curr;
  prev.lines = {Line({0, -1}, {4, -1}), Line({5, -1.5}, {8, -1.5})};  // The second 0.5 to the right.
  curr.lines = {Line({0, -1}, {4, -1}), Line({5, -0.5}, {8, -0.5})};  // 0.5 to the left.
  const VoteTable votes = Votes(
      prev, curr, [](const ScanPair& scans, VoteTable& table) { VoteByParallels(scans, kTolerances, kUnique, table); });
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) EXPECT_EQ(votes.At(i, j), 0.0);
  }
}

TEST(LengthVotes, GoToBothEndedLinesOfEqualLengthAndAgainstUnequalOnes) {
  ScanFeatures prev, curr;
  prev.angle_step_rad = curr.angle_step_rad = Radians(1.0);
  prev.lines = {Line({2, -0.5}, {2, 0.5}, EndClass::kBothEnded), Line({2, 1}, {2, 2}, EndClass::kLeftEnded)};
  curr.lines = {Line({2, -0.4}, {2, 0.62}, EndClass::kBothEnded), Line({2, -1}, {2, 1}, EndClass::kBothEnded)};
  const VoteTable votes = Votes(
      prev, curr, [](const ScanPair& scans, VoteTable& table) { VoteByLengths(scans, kTolerances, kUnique, table); });
  EXPECT_DOUBLE_EQ(votes.At(0, 0), kUnique);
  EXPECT_DOUBLE_EQ(votes.At(0, 1), -1.0);
  EXPECT_DOUBLE_EQ(votes.At(1, 1), 0.0);
}

TEST(LengthVotes, ToleranceIsThatOf313ForAFacingLine) {
  const LineFeature line = Line({5, -1}, {5, 1});
  EXPECT_NEAR(EndpointTolerance(line, line, Radians(1.0)), 2.0 * std::tan(kPi / 180) * 2.0 * 5.0, 1e-9);
  const LineFeature nearer = Line({2, -1}, {2, 1});
  EXPECT_DOUBLE_EQ(EndpointTolerance(line, nearer, Radians(1.0)), EndpointTolerance(nearer, line, Radians(1.0)));
  EXPECT_GT(EndpointTolerance(Line({5, 0}, {8, 3}), Line({5, 0}, {8, 3}), Radians(1.0)),
            EndpointTolerance(line, line, Radians(1.0)));
}

TEST(PatternVotes, RunAlongTheDiagonalOfAShiftedScan) {
  const test::World world = test::Office();
  const test::Laser laser = test::FullTurnLaser(720);
  const ScanFeatures prev = ExtractFeatures(test::Look(world, {0, 0, 0.1}, laser), {});
  const ScanFeatures curr = ExtractFeatures(test::Look(world, {0.2, 0.1, 0.3}, laser), {});
  ASSERT_GE(prev.lines.size(), 8U);
  const Pose2 motion = Between(Pose2{0, 0, 0.1}, Pose2{0.2, 0.1, 0.3});
  const auto truth = [&](int i, int j) {
    const LineFeature &p = prev.lines[static_cast<std::size_t>(i)], &c = curr.lines[static_cast<std::size_t>(j)];
    return std::abs(p.OffsetOf(motion * c.midpoint())) < 0.05 &&
           std::abs(AngleDiff(p.slope, c.slope + motion.theta)) < 0.1;
  };
  for (const bool angles : {true, false}) {
    const VoteTable votes = Votes(prev, curr, [&](const ScanPair& scans, VoteTable& table) {
      if (angles) VoteByAnglePatterns(scans, kTolerances, table);
      if (!angles) VoteByDistancePatterns(scans, kTolerances, table);
    });
    double right = 0.0, wrong = 0.0;
    for (int i = 0; i < votes.rows(); ++i) {
      for (int j = 0; j < votes.columns(); ++j) (truth(i, j) ? right : wrong) += votes.At(i, j);
    }
    EXPECT_GT(right, 20.0) << angles;
    EXPECT_GT(right, (angles ? 2.0 : 10.0) * wrong) << angles;
  }
}

// The angles from each of four lines to the next ones; in the second scan all turns are so much larger.
TEST(PatternVotes, TakeTurnsForEqualThatDifferByLessThanTheTolerance) {
  const auto features = [](double more_deg) {
    ScanFeatures scan;
    scan.lines.resize(4);
    for (int line = 0; line < 4; ++line) {
      LinePattern& pattern = scan.patterns.emplace_back();
      pattern.count = 3 - line;
      for (int k = 0; k < pattern.count; ++k)
        pattern.angle[static_cast<std::size_t>(k)] = Radians((20.0 + more_deg) * (k + 1));
    }
    return scan;
  };
  const auto votes_at_first = [&](double more_deg) {
    return Votes(features(0.0), features(more_deg),
                 [](const ScanPair& scans, VoteTable& table) { VoteByAnglePatterns(scans, kTolerances, table); })
        .At(0, 0);
  };
  EXPECT_GT(votes_at_first(0.5), 0.0);
  EXPECT_EQ(votes_at_first(8.0), 0.0);
}

}  // namespace
}  // namespace cairn::slam
