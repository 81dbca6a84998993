#include "server/slam/trail/trail.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <random>
#include <utility>
#include <vector>

namespace cairn::slam {
namespace {

constexpr MotionNoise kDrift{0.01, 0.0, 0.0, 0.01, 0.0, 0.0};

// Keyframes on a straight line, 2 m apart.
Trail Chain(std::size_t keyframes) {
  Trail trail(kDrift);
  for (std::size_t k = 0; k < keyframes; ++k)
    trail.Append({std::make_shared<const Scan>(), {}}, {2.0 * static_cast<double>(k), 0.0, 0.0}, {},
                 Eigen::Matrix3d::Zero(), std::nullopt);
  return trail;
}

TEST(Trail, DistancesFollowTheChain) {
  const Trail trail = Chain(5);
  const std::span<const double> distances = trail.distances_m();
  EXPECT_EQ(std::vector<double>(distances.begin(), distances.end()), (std::vector<double>{8, 6, 4, 2, 0}));
  EXPECT_TRUE(trail.relations().empty());  // Nothing was seen again.
}

TEST(Trail, ALoopIsAShortCutBothWays) {
  Trail trail = Chain(11);
  trail.AddLoop({1, 9, {0.5, 0.0, 0.0}, Eigen::Matrix3d::Identity(), true});
  const std::span<const double> distance = trail.distances_m();
  EXPECT_DOUBLE_EQ(distance[9], 2.0);
  EXPECT_DOUBLE_EQ(distance[1], 2.5);
  EXPECT_DOUBLE_EQ(distance[0], 4.5);
  EXPECT_DOUBLE_EQ(distance[2], 4.5);
  EXPECT_DOUBLE_EQ(distance[5], 10.0);  // The farthest keyframe: both ways round have the same length.
  EXPECT_EQ(trail.relations().size(), 11U);
}

// Loops of all lengths, also of none, between any two keyframes: every relation is applied until no distance changes.
TEST(Trail, DistancesAreThoseThatNoRelationShortens) {
  std::mt19937 random(4);
  const auto length_m = [&](double most) { return std::uniform_real_distribution<double>(0.0, most)(random); };
  Trail trail(kDrift);
  double x = 0.0;
  for (int k = 0; k < 400; ++k) {
    trail.Append({std::make_shared<const Scan>(), {}}, {x, 0.0, 0.0}, {}, Eigen::Matrix3d::Zero(), std::nullopt);
    if (k % 9 != 0) x += length_m(k % 50 == 0 ? 30.0 : 0.4);
  }
  std::vector<std::pair<std::size_t, std::size_t>> ends;
  std::vector<double> ways;
  for (int i = 0; i < 300; ++i) {
    ends.emplace_back(random() % 400, random() % 400);
    ways.push_back(i % 5 == 0 ? 0.0 : length_m(5.0));
    trail.AddLoop({ends.back().first, ends.back().second, {ways.back(), 0.0, 0.0}, Eigen::Matrix3d::Identity(), true});
  }
  std::vector<double> shortest(400, std::numeric_limits<double>::infinity());
  shortest.back() = 0.0;
  bool changes = true;
  const auto shorten = [&](std::size_t to, double way_m) {
    if (!(way_m < shortest[to])) return;
    shortest[to] = way_m;
    changes = true;
  };
  const auto travelled_m = [&](std::size_t k) { return trail.shapes()[k].travelled_m; };
  while (std::exchange(changes, false)) {
    for (std::size_t k = 1; k < 400; ++k) {
      shorten(k, shortest[k - 1] + travelled_m(k) - travelled_m(k - 1));
      shorten(k - 1, shortest[k] + travelled_m(k) - travelled_m(k - 1));
    }
    for (std::size_t i = 0; i < ends.size(); ++i) {
      shorten(ends[i].second, shortest[ends[i].first] + ways[i]);
      shorten(ends[i].first, shortest[ends[i].second] + ways[i]);
    }
  }
  const std::span<const double> distances = trail.distances_m();
  EXPECT_EQ(std::vector<double>(distances.begin(), distances.end()), shortest);
}

// A step of no length after a way of a round number of metres: with rounding the sum may be a little shorter than
// the way before it.
TEST(Trail, DistancesGoOnWhereRoundingMakesAWayShorter) {
  for (int i = 1; i <= 50; ++i) {
    Trail trail(kDrift);
    const double x = 0.1 * i;
    for (const double at : {0.0, x, x, x + 100.0})
      trail.Append({std::make_shared<const Scan>(), {}}, {at, 0.0, 0.0}, {}, Eigen::Matrix3d::Zero(), std::nullopt);
    trail.AddLoop({2, 3, {0.25, 0.0, 0.0}, Eigen::Matrix3d::Identity(), true});
    EXPECT_NEAR(trail.distances_m()[0], x + 0.25, 1e-9) << x;
  }
}

// Keyframes on a line, with loops to old ones. Each trail is asked about one way only, at some keyframes only, and the
// newest keyframes first, so that earlier distances decide most answers.
TEST(Trail, WhetherAKeyframeIsFartherFollowsTheDistancesAlsoLongAfterTheyWereComputed) {
  for (const double way_m : {0.5, 10.5, 40.5}) {
    Trail asked(kDrift);
    for (std::size_t k = 0; k < 120; ++k) {
      std::optional<RevisitObservation> revisit;
      if (k > 60 && k % 7 == 0) revisit = RevisitObservation{k - 60, {0.3, 0.0, 0.0}, Eigen::Matrix3d::Identity()};
      asked.Append({std::make_shared<const Scan>(), {}}, {1.0 * static_cast<double>(k), 0.0, 0.0}, {},
                   Eigen::Matrix3d::Zero(), revisit);
      if (k % 5 != 0) continue;
      const Trail computed = asked;
      for (std::size_t other = k + 1; other-- > 0;)
        EXPECT_EQ(asked.IsFarther(other, way_m), computed.distances_m()[other] > way_m)
            << "keyframe " << other << " from " << k << ", " << way_m << " m";
    }
  }
}

// What an earlier job has found is no measurement for the next one, and does not pile up.
TEST(Trail, AShapeIsKeptOnceAndIsNoMeasurement) {
  Trail trail = Chain(10);
  EXPECT_TRUE(trail.steps_of_shaped().empty());
  const PoseRelation bent{0, 9, {17.0, 2.0, 0.1}, Eigen::Matrix3d::Identity(), true};
  trail.SetShape({bent});
  EXPECT_EQ(trail.relations().size(), 10U);
  EXPECT_TRUE(KeepsShape(trail.relations().back()));
  EXPECT_TRUE(trail.measured().empty()) << "no place was seen again";
  EXPECT_EQ(trail.steps_of_shaped().size(), 9U);
  EXPECT_DOUBLE_EQ(trail.distances_m()[0], 18.0) << "nor is it a short cut";
  EXPECT_EQ(trail.RevisitsWithin(100.0, 18.0), 0U);
  trail.SetShape({bent, {4, 9, {9.0, 0.0, 0.0}, Eigen::Matrix3d::Identity(), true}});
  EXPECT_EQ(trail.relations().size(), 11U) << "in place of the one before";
  trail.AddLoop({0, 5, {10.0, 0.0, 0.0}, PoseCovariance(0.1, 0.01), true});
  EXPECT_EQ(trail.measured().size(), 10U);
  EXPECT_TRUE(std::ranges::none_of(trail.measured(), KeepsShape));
  EXPECT_TRUE(trail.steps_of_shaped().empty());
  trail.SetShape({});
  EXPECT_EQ(trail.relations().size(), 10U);
}

TEST(Trail, ARevisitIsALoopOfTheKeyframeThatSawIt) {
  Trail trail = Chain(10);
  trail.Append({std::make_shared<const Scan>(), {}}, {20.0, 0.0, 0.0}, {}, Eigen::Matrix3d::Zero(),
               RevisitObservation{2, {0.0, 1.0, 0.0}, Eigen::Matrix3d::Identity()});
  EXPECT_DOUBLE_EQ(trail.distances_m()[2], 1.0);
  const std::vector<PoseRelation> relations = trail.relations();
  ASSERT_EQ(relations.size(), 11U);
  EXPECT_TRUE(relations.back().loop);
  EXPECT_EQ(relations.back().to, 10U);
}

TEST(Trail, CountsTheRevisitsOfTheLastMetres) {
  Trail trail = Chain(10);
  const auto append = [&trail](double at_m, std::size_t seen) {
    trail.Append({std::make_shared<const Scan>(), {}}, {at_m, 0.0, 0.0}, {}, Eigen::Matrix3d::Zero(),
                 RevisitObservation{seen, {}, Eigen::Matrix3d::Identity()});
  };
  const double end_m = trail.shapes().back().travelled_m;
  append(end_m + 1.0, 2);
  append(end_m + 2.0, 3);
  EXPECT_EQ(trail.RevisitsWithin(0.5, end_m + 3.0), 0U);
  EXPECT_EQ(trail.RevisitsWithin(1.5, end_m + 3.0), 1U);
  EXPECT_EQ(trail.RevisitsWithin(2.5, end_m + 3.0), 2U);
  EXPECT_EQ(trail.RevisitsWithin(100.0, end_m + 3.0), 2U) << "a keyframe that is seen again has seen nothing again";
}

TEST(Trail, TentativeKeyframesCountOnceThePathIsCorrectedAndBlindMotionNever) {
  Trail trail(MotionNoise{});
  const auto append = [&trail](bool localized, bool on_the_path) {
    trail.Append({std::make_shared<const Scan>(), {}}, {}, {}, Eigen::Matrix3d::Identity(), std::nullopt);
    trail.MarkLast(localized, on_the_path);
  };
  const auto localized = [](const std::vector<Keyframe>& keyframes) {
    std::vector<bool> all;
    for (const Keyframe& keyframe : keyframes) all.push_back(keyframe.localized);
    return all;
  };
  append(true, true);
  append(false, true);
  append(false, false);
  EXPECT_EQ(localized(trail.keyframes()), (std::vector<bool>{true, false, false}));
  EXPECT_EQ(localized(trail.ConfirmedKeyframes()), (std::vector<bool>{true, true, false}));
  EXPECT_FALSE(trail.keyframes()[1].localized);  // Only asked, not done.
  trail.ConfirmTentative();
  append(false, true);
  EXPECT_FALSE(trail.keyframes()[1].tentative);
  EXPECT_EQ(localized(trail.keyframes()), (std::vector<bool>{true, true, false, false}));
}

const Eigen::Matrix3d kNoCovariance = Eigen::Matrix3d::Zero();

// Keyframes at the corners of a square of 1 m, in the front-end's frame; the robot turns left before each new side.
constexpr std::array<Pose2, 4> kSquare = {Pose2{0, 0, kPi / 2}, Pose2{0, 1, kPi}, Pose2{-1, 1, -kPi / 2},
                                          Pose2{-1, 0, 0}};

Trail Square(const Eigen::Matrix3d& step_covariance = kNoCovariance,
             const std::optional<RevisitObservation>& last_revisit = std::nullopt) {
  Trail trail(MotionNoise{});
  for (std::size_t k = 0; k < kSquare.size(); ++k) {
    std::vector<SurfacePoint> points(k + 1);
    trail.Append({std::make_shared<const Scan>(), kSquare[k]}, kSquare[k], std::move(points), step_covariance,
                 k + 1 == kSquare.size() ? last_revisit : std::nullopt);
  }
  return trail;
}

TEST(Trail, AnEmptyOneHasNoDistanceAndNoLastPose) {
  const Trail trail(MotionNoise{});
  EXPECT_TRUE(trail.empty());
  EXPECT_EQ(trail.FromLast({3, 4, 1}), Pose2{});
  EXPECT_EQ(trail.TravelledTo({3, 4, 1}), 0.0);
}

TEST(Trail, KeepsThePointsTheWayAndTheDistances) {
  const Trail trail = Square();
  ASSERT_EQ(trail.size(), 4U);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(trail.shapes()[k].T_track_robot, kSquare[k]);
    EXPECT_EQ(trail.points(k)->size(), k + 1);
    EXPECT_NEAR(trail.shapes()[k].travelled_m, static_cast<double>(k), 1e-12);
    EXPECT_NEAR(trail.distances_m()[k], 3.0 - static_cast<double>(k), 1e-12);  // Back along the steps.
  }
  const Pose2 ahead = trail.FromLast(kSquare[3] * Pose2{0.5, 0.1, 0.2});
  EXPECT_NEAR(ahead.x, 0.5, 1e-12);
  EXPECT_NEAR(ahead.y, 0.1, 1e-12);
  EXPECT_NEAR(ahead.theta, 0.2, 1e-12);
  EXPECT_NEAR(trail.TravelledTo(kSquare[3] * Pose2{0.5, 0.0, 0.0}), 3.5, 1e-12);
  EXPECT_TRUE(trail.relations().empty()) << "no place was seen again";
}

TEST(Trail, ARevisitIsARelationWithItsOwnCovarianceAndAShorterWay) {
  const Eigen::Matrix3d covariance = Eigen::Vector3d(0.01, 0.02, 0.03).asDiagonal();
  const Eigen::Matrix3d step_covariance = Eigen::Vector3d(0.4, 0.5, 0.6).asDiagonal();
  const Pose2 seen{0.0, 1.0, -kPi / 2};
  const Trail trail = Square(step_covariance, RevisitObservation{0, seen, covariance});
  const std::vector<PoseRelation> relations = trail.relations();
  ASSERT_EQ(relations.size(), 4U);
  const auto revisit =
      std::find_if(relations.begin(), relations.end(), [](const PoseRelation& relation) { return relation.loop; });
  ASSERT_NE(revisit, relations.end());
  EXPECT_EQ(revisit->from, 0U);
  EXPECT_EQ(revisit->to, 3U);
  EXPECT_EQ(revisit->T_from_to, seen);
  EXPECT_TRUE(revisit->covariance.isApprox(covariance, 1e-3)) << revisit->covariance;
  EXPECT_NEAR(trail.distances_m()[0], 1.0, 1e-12);
  EXPECT_NEAR(trail.distances_m()[1], 2.0, 1e-12);
  for (const PoseRelation& relation : relations) {
    if (relation.loop) continue;
    EXPECT_EQ(relation.to, relation.from + 1);
    EXPECT_NEAR(relation.T_from_to.translation().norm(), 1.0, 1e-12);
    EXPECT_GE(relation.covariance(0, 0), 0.4);
    EXPECT_GE(relation.covariance(2, 2), 0.6);
  }
}

TEST(Trail, ALoopChangesThePathOnlyOnceItIsAdded) {
  Trail trail = Square(0.04 * Eigen::Matrix3d::Identity());
  std::vector<Pose2> path(kSquare.begin(), kSquare.end());
  // The last keyframe was seen 0.5 m farther on than the steps say.
  const PoseRelation loop{0, 3, Between(kSquare[0], kSquare[3] * Pose2{0.5, 0.0, 0.0}),
                          1e-4 * Eigen::Matrix3d::Identity(), true};
  const auto closed = trail.PathWithLoop(loop, path, PoseGraphOptions{});
  ASSERT_TRUE(closed);
  EXPECT_LT(Between(kSquare[3] * Pose2{0.5, 0.0, 0.0}, closed->back()).translation().norm(), 0.05);
  EXPECT_EQ(closed->front(), kSquare[0]);
  EXPECT_TRUE(trail.relations().empty());
  EXPECT_NEAR(trail.distances_m()[0], 3.0, 1e-12);
  trail.AddLoop(loop);
  EXPECT_EQ(trail.relations().size(), 4U);
  EXPECT_LT(trail.distances_m()[0], 2.0);
}

// The steps say to 0.1 m where the last keyframe is. A loop that says otherwise by metres must not move the path, nor
// be kept, also where the search has found it twice.
TEST(Trail, AWrongLoopIsOutvotedAndNotTaken) {
  const Trail trail = Chain(6);
  std::vector<Pose2> path;
  for (std::size_t k = 0; k < 6; ++k) path.push_back({2.0 * static_cast<double>(k), 0.0, 0.0});
  const Eigen::Matrix3d covariance = PoseCovariance(0.1, 0.01);
  EXPECT_FALSE(trail.PathWithLoop({0, 5, {6.0, 0.0, 0.0}, covariance, true}, path, PoseGraphOptions{}));
  EXPECT_FALSE(trail.PathWithLoop({0, 5, {10.0, 4.0, 0.0}, covariance, true}, path, PoseGraphOptions{}));
  EXPECT_TRUE(trail.PathWithLoop({0, 5, {10.3, 0.1, 0.0}, covariance, true}, path, PoseGraphOptions{}));
}

TEST(Trail, APathThatCannotBeFittedIsNoPath) {
  Trail trail(MotionNoise{});
  trail.Append({std::make_shared<const Scan>(), {}}, {}, {}, kNoCovariance, std::nullopt);
  EXPECT_FALSE(trail.PathWithLoop({0, 0, {}, Eigen::Matrix3d::Identity(), true}, {Pose2{}}, PoseGraphOptions{}));
}

TEST(Trail, ScansLieBehindTheLastKeyframeAndFollowWhereItsPathGoes) {
  Trail trail(MotionNoise{});
  trail.Append({std::make_shared<const Scan>(), {}}, {}, {}, kNoCovariance, std::nullopt);
  trail.AddScan(10, {});
  trail.Append({std::make_shared<const Scan>(), {}}, {1, 0, 0}, {}, kNoCovariance, std::nullopt);
  trail.AddScan(20, {});
  trail.AddScan(30, {0.5, 0, 0});
  MapperSnapshot snapshot;
  snapshot.scans = trail.scans();
  const Trajectory trajectory = snapshot.TrajectoryAlong(std::vector<Pose2>{{}, {1, 2, kPi / 2}});
  ASSERT_EQ(trajectory.size(), 3U);
  EXPECT_EQ(trajectory[0].T_map_robot, Pose2{});
  EXPECT_EQ(trajectory[1].T_map_robot, (Pose2{1, 2, kPi / 2}));
  EXPECT_EQ(trajectory[2].stamp, 30);
  EXPECT_NEAR(trajectory[2].T_map_robot.x, 1.0, 1e-12);
  EXPECT_NEAR(trajectory[2].T_map_robot.y, 2.5, 1e-12);
}

}  // namespace
}  // namespace cairn::slam
