#include "server/slam/localisation/line_match.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>

#include "server/slam/features/feature_extraction.h"
#include "server/slam/localisation/place_hypotheses.h"
#include "server/slam/motion/odometry_model.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

// Walls of a test world run with the free side on the right for boxes and on the left for rooms; both sides
// are safe.
std::vector<MapLine> MapOf(const test::World& world) {
  std::vector<MapLine> map;
  for (const auto& [a, b] : world.walls) {
    map.push_back({a, b});
    map.push_back({b, a});
  }
  return map;
}

LineMatchAnswer Locate(const test::World& world, const Pose2& T_map_robot, const test::Laser& laser,
                       std::mt19937_64* engine = nullptr) {
  return MatchLinesWithMap(MapOf(world),
                           ExtractFeatures(test::Look(world, T_map_robot, laser, engine), FeatureOptions{}).lines, {});
}

double Away(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() + std::abs(AngleDiff(a.theta, b.theta));
}

TEST(LineMatch, FindsThePlaceInAKnownWorldFromNothing) {
  std::mt19937_64 engine(5);
  test::Laser laser = test::FullTurnLaser(720);
  laser.sigma_m = 0.005;
  int first = 0, among = 0;
  constexpr int kPlaces = 30;
  std::uniform_real_distribution<double> x(-2.5, 1.5), y(-1.8, 2.7), theta(-kPi, kPi);
  for (int run = 0; run < kPlaces; ++run) {
    const Pose2 truth{x(engine), y(engine), theta(engine)};
    const LineMatchAnswer answer = Locate(test::Office(), truth, laser, &engine);
    EXPECT_TRUE(answer.complete);
    if (answer.hypotheses.empty()) continue;
    if (Away(answer.hypotheses[0].T_map_robot, truth) < 0.08) ++first;
    for (const LineMatchHypothesis& hypothesis : answer.hypotheses) {
      EXPECT_TRUE(IsCovariance(hypothesis.covariance));
      if (Away(hypothesis.T_map_robot, truth) < 0.08) {
        ++among;
        break;
      }
    }
  }
  std::printf("from nothing: first of the hypotheses %d, among them %d, of %d\n", first, among, kPlaces);
  EXPECT_GE(among, kPlaces - 2);
  EXPECT_GE(first, kPlaces * 3 / 4);
}

TEST(LineMatch, ARectangleHasTwoAnswersAndOdometryKnowsWhich) {
  const test::World room = test::Room(-3, -2, 6, 4);
  const test::Laser laser = test::FullTurnLaser(360);
  Pose2 truth{0.8, 0.5, 0.3};
  PoseBelief belief = PoseBelief::Unknown();
  belief.T_map_robot = {0.5, 0.5, 0.0};  // A rough heading is enough to choose between the two.
  belief.covariance = Eigen::Vector3d(1.0, 1.0, 0.25).asDiagonal();
  for (int step = 0; step < 8; ++step) {
    const LineMatchAnswer answer = Locate(room, truth, laser);
    ASSERT_EQ(answer.hypotheses.size(), 2U);
    const auto nearest = Nearest(belief, answer.hypotheses);
    ASSERT_TRUE(nearest.has_value());
    belief = Fuse(belief, answer.hypotheses[*nearest]);
    EXPECT_LT(Away(belief.T_map_robot, truth), 0.03);
    EXPECT_TRUE(IsCovariance(belief.covariance));
    DeadReckon(belief.T_map_robot, belief.covariance, {0.22, 0.0, 0.31},  // 10 % too far.
               Eigen::Vector3d(0.0025, 0.0001, 0.01).asDiagonal());
    truth = truth * Pose2{0.2, 0.0, 0.3};
  }
}

TEST(LineMatch, TheFirstHypothesisIsTheBeliefOfWhoKnewNothing) {
  const LineMatchHypothesis found{{3, -2, 2.5}, Eigen::Vector3d(1e-4, 4e-4, 1e-4).asDiagonal(), 1.0, 4};
  const PoseBelief belief = Fuse(PoseBelief::Unknown(), found);
  EXPECT_LT(Away(belief.T_map_robot, found.T_map_robot), 1e-6);
  EXPECT_LT((belief.covariance - found.covariance).norm(), 1e-7);
}

TEST(LineMatch, FusionIsTheTextbooks) {
  const PoseBelief belief{{1, 2, 0.3}, Eigen::Vector3d(0.04, 0.01, 0.02).asDiagonal()};
  LineMatchHypothesis found{{1.1, 1.9, 0.4}, Eigen::Vector3d(0.01, 0.02, 0.005).asDiagonal(), 1.0, 4};
  found.covariance(0, 1) = found.covariance(1, 0) = 0.004;
  const PoseBelief fused = Fuse(belief, found);
  const Eigen::Matrix3d P = belief.covariance.inverse(), S = found.covariance.inverse();
  const Eigen::Matrix3d covariance = (P + S).inverse();  // (2.18) as printed.
  const Eigen::Vector3d mean = covariance * (P * belief.T_map_robot.vector() + S * found.T_map_robot.vector());
  EXPECT_LT((fused.covariance - covariance).norm(), 1e-12);
  EXPECT_LT((fused.T_map_robot.vector() - mean).norm(), 1e-12);
}

// Two corners of a room, and an object in front of one wall whose line has no wall in the map.
TEST(LineMatch, AsPrintedEveryScanLineMustBePaired) {
  const auto map = MapOf(test::Room(-3, -2, 6, 4));
  test::World with_box = test::Room(-3, -2, 6, 4);
  with_box.Add({{1.0, 0.4}, {1.0, 1.4}});
  const Pose2 truth{0.0, -0.5, 0.3};
  const auto clear = ExtractFeatures(test::Look(test::Room(-3, -2, 6, 4), truth, test::FullTurnLaser(360)), {}).lines;
  const auto crowded = ExtractFeatures(test::Look(with_box, truth, test::FullTurnLaser(360)), {}).lines;
  LineMatchOptions printed;
  printed.pairing = LineMatchPairing::kRecursive;
  const LineMatchAnswer ours = MatchLinesWithMap(map, crowded, {});
  ASSERT_FALSE(ours.hypotheses.empty());
  EXPECT_LT(Away(ours.hypotheses.front().T_map_robot, truth), 0.05);
  EXPECT_TRUE(MatchLinesWithMap(map, crowded, printed).hypotheses.empty());
  const LineMatchAnswer found = MatchLinesWithMap(map, clear, printed);
  EXPECT_TRUE(found.complete);
  ASSERT_EQ(found.hypotheses.size(), 2U);  // A rectangle looks the same turned by half a turn.
  for (const LineMatchHypothesis& hypothesis : found.hypotheses) {
    EXPECT_EQ(hypothesis.share, 1.0);
    EXPECT_EQ(hypothesis.pairs, static_cast<int>(clear.size()));
  }
}

// Both long walls stand twice in the map, 0.1 m apart. The first of them is paired in both ways by either
// search; ours then takes for the other one the wall it lies nearest to, the recursion both.
TEST(LineMatch, AsPrintedEveryWallThatFitsIsTried) {
  std::vector<MapLine> map = MapOf(test::Room(-3, -2, 6, 4));
  for (const double y : {2.1, -2.1}) {
    map.push_back({{-3.0, y}, {3.0, y}});
    map.push_back({{3.0, y}, {-3.0, y}});
  }
  const Pose2 truth{0.4, -0.5, 0.3};
  const auto lines = ExtractFeatures(test::Look(test::Room(-3, -2, 6, 4), truth, test::FullTurnLaser(360)), {}).lines;
  LineMatchOptions options;
  options.same_m = 0.0;  // Every assignment is reported as an answer of its own.
  const auto complete_assignments = [&] {
    const LineMatchAnswer answer = MatchLinesWithMap(map, lines, options, LineMatchWindow{truth, 0.3, 0.3});
    EXPECT_TRUE(answer.complete);
    return std::ranges::count_if(answer.hypotheses, [](const auto& hypothesis) { return hypothesis.share == 1.0; });
  };
  EXPECT_EQ(complete_assignments(), 2);
  options.pairing = LineMatchPairing::kRecursive;
  EXPECT_GE(complete_assignments(), 3);
}

TEST(LineMatch, AFarHypothesisIsNotTaken) {
  const PoseBelief belief{{0, 0, 0}, Eigen::Vector3d(0.01, 0.01, 0.01).asDiagonal()};
  const std::vector<LineMatchHypothesis> far{{{2, 0, 0}, 1e-4 * Eigen::Matrix3d::Identity(), 1.0, 4}};
  EXPECT_FALSE(Nearest(belief, far).has_value());
}

TEST(LineMatch, DegenerateScansGiveNoPlace) {
  const auto map = MapOf(test::Office());
  EXPECT_TRUE(MatchLinesWithMap(map, {}, {}).hypotheses.empty());
  EXPECT_TRUE(MatchLinesWithMap({}, {}, {}).hypotheses.empty());
  test::World corridor;
  corridor.Add({{-50, 1}, {50, 1}}).Add({{-50, -1}, {50, -1}});
  test::Laser laser;
  laser.range_max_m = 8.0;
  EXPECT_TRUE(Locate(corridor, {}, laser).hypotheses.empty());
}

TEST(LineMatch, AWindowLeavesOutWhatIsOutsideAndNothingElse) {
  const auto map = MapOf(test::Room(-3, -2, 6, 4));
  const Pose2 truth{0.8, 0.5, 0.3};
  const auto lines =
      ExtractFeatures(test::Look(test::Room(-3, -2, 6, 4), truth, test::FullTurnLaser(360)), FeatureOptions{}).lines;
  const LineMatchAnswer all = MatchLinesWithMap(map, lines, {});
  ASSERT_EQ(all.hypotheses.size(), 2U);
  const LineMatchAnswer near = MatchLinesWithMap(map, lines, {}, LineMatchWindow{{0.5, 0.3, 0.2}, 0.6, 0.3});
  ASSERT_EQ(near.hypotheses.size(), 1U);
  EXPECT_LT(Away(near.hypotheses[0].T_map_robot, truth), 0.03);
  EXPECT_TRUE(MatchLinesWithMap(map, lines, {}, LineMatchWindow{{0.5, 0.3, 0.2}, 0.2, 0.3}).hypotheses.empty());
  EXPECT_TRUE(MatchLinesWithMap(map, lines, {}, LineMatchWindow{{0.8, 0.5, 0.7}, 0.6, 0.3}).hypotheses.empty());
}

// A corner fits every crossing of a grid of walls, so there are very many places. They must take little time
// and memory.
TEST(LineMatch, AMapThatLooksAlikeEverywhereIsBounded) {
  std::vector<MapLine> grid;
  for (int k = 0; k < 1000; ++k) {
    grid.push_back({{3.0 * k, -5000}, {3.0 * k, 5000}});
    grid.push_back({{5000, 3.0 * k}, {-5000, 3.0 * k}});
  }
  test::World corner;
  corner.Add({{2, -2}, {2, 2}, {-2, 2}});
  const auto lines = ExtractFeatures(test::Look(corner, {}, test::FullTurnLaser(360)), FeatureOptions{}).lines;
  ASSERT_GE(lines.size(), 2U);
  const LineMatchAnswer answer = MatchLinesWithMap(grid, lines, {});
  EXPECT_FALSE(answer.complete);
  EXPECT_GT(answer.hypotheses.size(), 1U);
  EXPECT_LE(answer.hypotheses.size(), static_cast<std::size_t>(LineMatchOptions{}.max_hypotheses) + 1);
}

TEST(LineMatch, TheSearchIsBounded) {
  LineMatchOptions options;
  options.max_comparisons = 10;
  const auto lines = ExtractFeatures(test::Look(test::Office(), {}, {}), FeatureOptions{}).lines;
  EXPECT_FALSE(MatchLinesWithMap(MapOf(test::Office()), lines, options).complete);
}

}  // namespace
}  // namespace cairn::slam
