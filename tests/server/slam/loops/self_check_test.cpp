#include "server/slam/loops/self_check.h"

#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <random>

#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::Look;

constexpr double kRoundM = 2.0 * (38.0 + 18.0);

// The corridor with a crate by one of its walls every four metres of the long sides.
test::World Refurnished() {
  test::World world = test::RingCorridor(true);
  for (double x = 2.0; x < 37.0; x += 4.0)
    for (const double y : {-1.0, 18.6}) world.Add({{x, y}, {x, y + 0.4}, {x + 0.6, y + 0.4}, {x + 0.6, y}});
  return world;
}

// A robot that drives round a corridor, and the path that it believes.
struct Belief {
  test::World world = test::RingCorridor(true);
  const Laser laser{.range_max_m = 12.0, .sigma_m = 0.01};
  std::mt19937_64 rng{5};
  Pose2 truth;
  Trail trail{MotionNoise{}};
  PosePath path;
  PathIndex index;

  [[nodiscard]] double travelled_m() const { return trail.TravelledTo(truth); }
  void Show(SelfCheck& check) {
    index.Follow(path);
    check.Look(trail, index);
  }

  // `crowd`: the share of the beams that end early at something that moves.
  void Step(const Pose2& motion, const Pose2& T_map_world, double crowd) {
    Scan scan = Look(world, truth, laser, &rng);
    std::uniform_real_distribution<double> any(0.0, 1.0);
    for (float& range : scan.ranges_m)
      if (any(rng) < crowd) range *= static_cast<float>(0.2 + 0.7 * any(rng));
    std::vector<SurfacePoint> points = SurfacePointsOf(PointsOf(scan), scan, {});
    trail.Append({std::make_shared<const Scan>(std::move(scan)), truth}, truth, std::move(points),
                 Eigen::Matrix3d::Zero(), std::nullopt);
    path.Append(T_map_world * truth);
    truth = truth * motion;
  }
};

// Where the check first reported an error, and whether it still does at the end.
struct Verdict {
  std::optional<double> said_at_m;
  bool at_end = false;
};

// Two rounds. `T_map_world(metres)` is the error of the belief after this distance.
Verdict DriveTwice(Belief& belief, SelfCheck& check, const std::function<Pose2(double)>& T_map_world,
                   double crowd = 0.0) {
  Verdict verdict;
  for (const Pose2& step : test::RingSteps(2.0 * kRoundM, 0.25)) {
    belief.Step(step, T_map_world(belief.travelled_m()), crowd);
    belief.Show(check);
    if (check.contradicted() && !verdict.said_at_m) verdict.said_at_m = belief.travelled_m();
  }
  verdict.at_end = check.contradicted();
  return verdict;
}

Pose2 Right(double /*way_m*/) {
  return {};
}

// The second round is drawn beside the first, `shift_m` away, so that all walls are doubled.
std::function<Pose2(double)> SecondRoundOff(const Pose2& off) {
  return [off](double way_m) { return way_m < kRoundM ? Pose2{} : off; };
}

TEST(SelfCheck, AConsistentWorldIsNeverContradicted) {
  Belief belief;
  SelfCheck check({});
  EXPECT_FALSE(DriveTwice(belief, check, Right).said_at_m);
}

TEST(SelfCheck, DoubledWallsAreNoticedWithinAStretch) {
  for (const Pose2& off : {Pose2{0.0, 0.4, 0.0}, Pose2{0.35, -0.35, 0.0}, Pose2{1.0, 0.8, 0.0}}) {
    Belief belief;
    SelfCheck check({});
    const Verdict verdict = DriveTwice(belief, check, SecondRoundOff(off));
    ASSERT_TRUE(verdict.said_at_m) << off.x << ' ' << off.y;
    EXPECT_GT(*verdict.said_at_m, kRoundM);
    EXPECT_LT(*verdict.said_at_m, kRoundM + 12.0) << off.x << ' ' << off.y;
  }
}

TEST(SelfCheck, SmallErrorsAreNoContradiction) {
  Belief belief;
  SelfCheck check({});
  EXPECT_FALSE(DriveTwice(belief, check, SecondRoundOff({0.1, 0.1, 0.002})).said_at_m);
}

TEST(SelfCheck, ACrowdIsNoContradiction) {
  Belief belief;
  SelfCheck check({});
  EXPECT_FALSE(DriveTwice(belief, check, Right, 0.3).said_at_m);
}

TEST(SelfCheck, MovedFurnitureIsNoContradiction) {
  Belief belief;
  SelfCheck check({});
  const Verdict verdict = DriveTwice(belief, check, [&](double way_m) {
    if (way_m >= kRoundM) belief.world = Refurnished();
    return Pose2{};
  });
  EXPECT_FALSE(verdict.said_at_m);
}

TEST(SelfCheck, DriftAloneIsNotNoticedBeforeThereIsSomethingToCompare) {
  Belief belief;
  SelfCheck check({});
  const Verdict verdict = DriveTwice(belief, check, [](double way_m) {
    return Pose2{0.0, 0.0, 0.002 * std::min(way_m, kRoundM)};
  });
  ASSERT_TRUE(verdict.said_at_m);
  EXPECT_GT(*verdict.said_at_m, 0.9 * kRoundM);
}

TEST(SelfCheck, AgreesAgainOnceTheBeliefDoes) {
  Belief belief;
  SelfCheck check({});
  const Verdict verdict = DriveTwice(belief, check, [](double way_m) {
    return way_m > kRoundM && way_m < kRoundM + 30.0 ? Pose2{0.0, 0.5, 0.0} : Pose2{};
  });
  ASSERT_TRUE(verdict.said_at_m);
  EXPECT_FALSE(verdict.at_end);
}

TEST(SelfCheck, TheVerdictStandsWhereThereIsNothingToCompare) {
  Belief belief;
  SelfCheck check({});
  ASSERT_TRUE(DriveTwice(belief, check, SecondRoundOff({0.5, 0.5, 0.0})).at_end);
  // The robot moves to and fro on the spot, and is believed to be far from everything it has seen.
  for (int i = 0; i < 200; ++i) {
    belief.Step({i % 2 == 0 ? 0.25 : -0.25, 0, 0}, {1000.0 + i, 0.0, 0.0}, 0.0);
    belief.Show(check);
  }
  EXPECT_TRUE(check.contradicted());
}

TEST(SelfCheck, ForgetsOnceThePathIsPutRight) {
  Belief belief;
  SelfCheck check({});
  ASSERT_TRUE(DriveTwice(belief, check, SecondRoundOff({0.5, 0.5, 0.0})).at_end);
  check.Forget();
  EXPECT_FALSE(check.contradicted());
  belief.path = {};
  for (const KeyframeShape& shape : belief.trail.shapes()) belief.path.Append(shape.T_track_robot);  // The truth.
  for (const Pose2& step : test::RingSteps(30.0, 0.25)) {
    belief.Step(step, {}, 0.0);
    belief.Show(check);
    EXPECT_FALSE(check.contradicted());
  }
}

TEST(SelfCheck, SwitchedOffItSaysNothing) {
  Belief belief;
  SelfCheckOptions options;
  options.enabled = false;
  SelfCheck check(options);
  EXPECT_FALSE(DriveTwice(belief, check, SecondRoundOff({0.5, 0.5, 0.0})).said_at_m);
}

}  // namespace
}  // namespace cairn::slam
