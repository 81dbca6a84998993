#include "server/slam/matching/loop_search.h"

#include <gtest/gtest.h>

#include "server/slam/smoothing/keyframe_graph.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::RingCorridor;
using test::RingSteps;
using test::World;

// A robot that drives round the ring, tracked by a front-end that turns a little too far with every metre.
struct Drive {
  std::vector<Keyframe> keyframes;
  std::vector<KeyframeShape> shapes;
  std::vector<Pose2> truth;
  SharedSequence<Pose2> believed;
  KeyframeGraph graph{MotionNoise{0.002, 0.01, 0.005, 0.0005, 0.002, 0.005}};

  void Step(const World& world, const Pose2& motion, double drift_rad) {
    const Pose2 seen = motion * Pose2{0, 0, drift_rad};
    const bool first = truth.empty();
    truth.push_back(first ? Pose2{} : truth.back() * motion);
    const Pose2 T_track_robot = first ? Pose2{} : shapes.back().T_track_robot * seen;
    auto scan =
        std::make_shared<const Scan>(Look(world, truth.back(), Laser{.first_rad = -kPi / 2, .range_max_m = 12.0}));
    const double travelled_m = first ? 0.0 : shapes.back().travelled_m + motion.translation().norm();
    shapes.push_back({T_track_robot, travelled_m, SurfacePointsOf(PointsOf(*scan), *scan, {})});
    keyframes.push_back({scan, T_track_robot});
    believed.Append(T_track_robot);
    graph.Append(first ? Pose2{} : seen, Eigen::Matrix3d::Zero());
  }
};

struct Found {
  std::size_t now = 0;
  RevisitObservation loop;
};

// Drives `metres` along the ring.
std::optional<Found> DriveUntilFound(Drive& drive, const World& world, double metres, double drift_rad_per_m) {
  LoopSearch search({}, {});
  for (const Pose2& step : RingSteps(metres, 0.4)) {
    drive.Step(world, step, drift_rad_per_m * step.x);
    if (const auto loop = search.Find(drive.keyframes, drive.shapes, drive.believed, drive.graph.DistancesFromLast()))
      return Found{drive.truth.size() - 1, *loop};
  }
  return std::nullopt;
}

TEST(LoopSearch, FindsTheStartAfterTheRoundAlthoughItSeemsFarAway) {
  Drive drive;
  const auto found = DriveUntilFound(drive, RingCorridor(true), 150.0, 0.0015);
  ASSERT_TRUE(found);
  const Pose2 truth = Between(drive.truth[found->loop.keyframe], drive.truth[found->now]);
  const Pose2 believed = Between(drive.believed[found->loop.keyframe], drive.believed[found->now]);
  EXPECT_GT((believed.translation() - truth.translation()).norm(), 1.5) << "the drift must be worth a search";
  EXPECT_LT((found->loop.T_keyframe_robot.translation() - truth.translation()).norm(), 0.15);
  EXPECT_LT(std::abs(AngleDiff(found->loop.T_keyframe_robot.theta, truth.theta)), 0.02);
  EXPECT_TRUE(IsCovariance(found->loop.covariance));
}

// Before the robot is back there is nothing to find, and every corner of a bare ring looks like every other.
TEST(LoopSearch, FindsNothingWhereTheRobotHasNotBeen) {
  Drive drive;
  EXPECT_FALSE(DriveUntilFound(drive, RingCorridor(true), 100.0, 0.0015));
}

TEST(LoopSearch, ABareCorridorFitsAnywhereAndIsNotBelieved) {
  Drive drive;
  // Round all four corners and some way along the first side, but not to its corner.
  if (const auto found = DriveUntilFound(drive, RingCorridor(false), 140.0, 0.0015)) {
    // What the corner just passed fixes may be believed; it must then be right.
    const Pose2 truth = Between(drive.truth[found->loop.keyframe], drive.truth[found->now]);
    EXPECT_LT((found->loop.T_keyframe_robot.translation() - truth.translation()).norm(), 0.3);
  }
}

TEST(LoopSearch, CanBeSwitchedOff) {
  Drive drive;
  LoopSearch search(LoopOptions{.enabled = false}, {});
  drive.Step(RingCorridor(true), {}, 0.0);
  EXPECT_FALSE(search.Find(drive.keyframes, drive.shapes, drive.believed, drive.graph.DistancesFromLast()));
}

TEST(FreeSpace, ContradictsOnlyWhatBeamsWentThrough) {
  Drive drive;
  drive.Step(test::Room(-4, -4, 8, 8), {}, 0.0);
  const FreeSpace space(drive.keyframes, drive.shapes, {0, 0, 0});
  EXPECT_TRUE(space.Contradicts({2.0, 0.0}));
  EXPECT_FALSE(space.Contradicts({4.0, 0.0}));   // The wall itself.
  EXPECT_FALSE(space.Contradicts({6.0, 0.0}));   // Behind it.
  EXPECT_FALSE(space.Contradicts({-2.0, 0.0}));  // Behind the robot: never seen.
  EXPECT_FALSE(space.Contradicts({1e6, -1e6}));
}

}  // namespace
}  // namespace cairn::slam
