#include "server/slam/tracking/standstill.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include "server/slam/mapper.h"
#include "server/slam/methods.h"
#include "server/slam/random/draws.h"
#include "server/slam/state/archive.h"
#include "server/slam/tracking/front_end.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

constexpr double kSigmaM = 0.01, kSigmaRad = 0.002;

// Matches of a robot at a pose, with the noise that they tell times `more`.
class Matches {
 public:
  MatchResult At(const Pose2& T_track_robot, double more = 1.0) {
    MatchResult match;
    const Eigen::Vector3d draw = more * ThreeNormalDraws(rng_);
    match.T_ref_curr = T_track_robot * Pose2{kSigmaM * draw.x(), kSigmaM * draw.y(), kSigmaRad * draw.z()};
    match.converged = true;
    match.shown_covariance = Eigen::Vector3d(kSigmaM * kSigmaM, kSigmaM * kSigmaM, kSigmaRad * kSigmaRad).asDiagonal();
    return match;
  }

 private:
  Rng rng_{7};
};

double Away(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm();
}

// Where the robot is told to be after this match.
Pose2 Told(Standstill& standstill, const Pose2& T_odom_robot, const MatchResult& match) {
  return standstill.Take(T_odom_robot, match).value_or(match.T_ref_curr);
}

TEST(Standstill, ARobotThatHasNotMovedYetIsAtItsStart) {
  Matches matches;
  Standstill standstill;
  const Pose2 start{1.0, 2.0, 0.5}, odometry{7.0, 8.0, 0.9};
  standstill.Begin(start, odometry);
  for (int scan = 0; scan < 5000; ++scan) {
    ASSERT_EQ(Told(standstill, odometry, matches.At(start)), start) << scan;
  }
}

TEST(Standstill, ALidarThatIsNoisierThanItsScansTellHoldsAsWell) {
  Matches matches;
  Standstill standstill;
  standstill.Begin({}, {});
  int away = 0;
  for (int scan = 0; scan < 5000; ++scan) away += Told(standstill, {}, matches.At({}, 1.7)) == Pose2{} ? 0 : 1;
  EXPECT_EQ(away, 0);
}

TEST(Standstill, ARobotThatHasStoppedIsAtTheMeanOfItsMatches) {
  Matches matches;
  Standstill standstill;
  standstill.Begin({}, {});
  const Pose2 stop{3.0, 1.0, -0.4};
  for (int scan = 0; scan < 400; ++scan) {
    const std::optional<Pose2> held = standstill.Take(Pose2{3.0, 1.1, -0.3}, matches.At(stop));
    ASSERT_EQ(held.has_value(), scan > 0) << scan;  // With the first match it may still have moved.
    if (scan >= 100) {
      ASSERT_LT(Away(*held, stop), 0.004) << scan;
    }
  }
}

TEST(Standstill, ADrivingRobotIsWhereItsMatchesAre) {
  Matches matches;
  Standstill standstill;
  standstill.Begin({}, {});
  for (int scan = 1; scan < 100; ++scan) {
    const Pose2 here{0.002 * scan, 0.0, 0.0};
    ASSERT_FALSE(standstill.Take(here, matches.At(here))) << scan;
  }
}

// A cheap lidar has one match in some ten thousand that is wrong by centimetres.
TEST(Standstill, ASingleWrongMatchMovesNoRobotAndTwoThatAgreeDo) {
  Matches matches;
  Standstill standstill;
  standstill.Begin({}, {});
  const Pose2 stop{3.0, 1.0, -0.4}, wrong{3.0, 1.09, -0.4};
  for (int scan = 0; scan < 200; ++scan) static_cast<void>(standstill.Take({3.0, 0.0, 0.0}, matches.At(stop)));
  const std::optional<Pose2> held = standstill.Take({3.0, 0.0, 0.0}, matches.At(wrong));
  ASSERT_TRUE(held);
  EXPECT_LT(Away(*held, stop), 0.004);
  for (int scan = 0; scan < 5; ++scan) ASSERT_TRUE(standstill.Take({3.0, 0.0, 0.0}, matches.At(stop))) << scan;
  ASSERT_TRUE(standstill.Take({3.0, 0.0, 0.0}, matches.At(wrong)));
  EXPECT_FALSE(standstill.Take({3.0, 0.0, 0.0}, matches.At(wrong)));
}

// Odometry freezes, or somebody pushes the robot: at once where a scan shows it, soon where several do.
TEST(Standstill, FrozenOdometryHoldsNoRobotThatMoves) {
  for (const double step_m : {0.002, 0.005, 0.02, 0.3}) {
    Matches matches;
    Standstill standstill;
    standstill.Begin({}, {});
    double farthest_m = 0.0, last_m = 0.0;
    const auto scan = [&](const Pose2& here) {
      last_m = Away(Told(standstill, {}, matches.At(here)), here);
      farthest_m = std::max(farthest_m, last_m);
    };
    for (int i = 0; i < 200; ++i) scan({});
    EXPECT_EQ(last_m, 0.0);
    for (int i = 1; i <= 60; ++i) scan({step_m * i, 0.0, 0.0});
    EXPECT_LT(farthest_m, 9.0 * kSigmaM) << step_m;
    for (int i = 0; i < 100; ++i) scan({step_m * 60, 0.0, 0.0});
    EXPECT_LT(last_m, 4.0 * kSigmaM) << step_m;
  }
}

TEST(Standstill, MovesWithTheTrack) {
  Matches matches, same;
  Standstill standstill, other;
  standstill.Begin({}, {});
  other.Begin({}, {});
  const Pose2 T_new_old{4.0, -2.0, 1.0}, stop{1.0, 0.0, 0.2};
  for (int scan = 0; scan < 50; ++scan) {
    if (scan == 20) standstill.MoveTo(T_new_old);
    MatchResult match = matches.At(stop);
    const MatchResult expected = same.At(stop);
    if (scan >= 20) match.T_ref_curr = T_new_old * match.T_ref_curr;
    const Pose2 told = Told(standstill, {1.0, 0.0, 0.0}, match), as_before = Told(other, {1.0, 0.0, 0.0}, expected);
    ASSERT_LT(Away(told, scan >= 20 ? T_new_old * as_before : as_before), 1e-9) << scan;
  }
}

// The noise that a match is held against is that of its points.
TEST(Standstill, ALidarOfFourTimesTheNoiseHasSixteenTimesTheVariance) {
  const test::World world = test::RingCorridor(true);
  const auto variance = [&](double sigma_m) {
    const test::Laser laser{.range_max_m = 12.0, .sigma_m = sigma_m};
    std::mt19937_64 rng(5);
    const FrontEndOptions options;
    PointIndex index;
    for (const SurfacePoint& point : Look(test::Look(world, {}, laser, &rng), options).points_robot) index.Add(point);
    const ScanView view = Look(test::Look(world, {}, laser, &rng), options);
    const MatchResult match =
        AlignPointsToSurfaces(view.points_robot, index, {{}, {}, Eigen::Matrix3d::Identity()}, options.refine);
    EXPECT_TRUE(match.converged);
    return match.shown_covariance(1, 1);
  };
  const double ratio = variance(0.02) / variance(0.005);
  EXPECT_GT(ratio, 8.0);
  EXPECT_LT(ratio, 32.0);
}

// The alignment of a scan among noisy walls is off by millimetres, and odometry says that nothing moves.
TEST(Standstill, ANoisyLidarMovesNoRobotThatStands) {
  const FrontEndOptions options;
  FrontEnd front_end(options, MakeMatcher(MatcherKind::kVoting, {}), {});
  const test::World world = test::RingCorridor(true);
  const test::Laser laser{.range_max_m = 12.0, .sigma_m = 0.05};
  std::mt19937_64 rng(3);
  double farthest_m = 0.0;
  for (int scan = 0; scan < 40; ++scan) {
    const ScanView view = Look(test::Look(world, {}, laser, &rng), options);
    const TrackStep step = front_end.Track(view, {}, SerialFor);
    farthest_m = std::max(farthest_m, Away(step.T_track_robot, {}));
    if (scan == 0) {
      front_end.AddKeyframe(view);
    } else {
      ASSERT_EQ(step.T_track_held, Pose2{}) << scan;
    }
  }
  EXPECT_GT(farthest_m, 0.002);  // The track is that of the matches.
}

// Scans of a noisy lidar that stands, one a second.
class NoisyScans {
 public:
  std::shared_ptr<const Scan> Next() {
    auto scan = std::make_shared<Scan>(test::Look(world_, {}, {.range_max_m = 12.0, .sigma_m = 0.05}, &rng_));
    scan->stamp = kNanosPerSecond * ++seconds_;
    return scan;
  }

 private:
  test::World world_ = test::RingCorridor(true);
  std::mt19937_64 rng_{3};
  Stamp seconds_ = 0;
};

// What the mapper tells, and what it keeps of each scan, is where the robot stands.
TEST(Standstill, TheMapperTellsWhereTheRobotStands) {
  NoisyScans scans;
  const Pose2 start{2.0, 1.0, 0.3};
  Mapper mapper(MapperOptions{}, start, 1);
  for (int scan = 0; scan < 40; ++scan)
    ASSERT_LT(Away(mapper.Process(scans.Next(), {}, SerialFor).T_map_robot, start), 1e-9) << scan;
  const MapperSnapshot snapshot = mapper.Snapshot();
  ASSERT_EQ(snapshot.scans.size(), 40u);
  for (const MapperSnapshot::ScanPlace& scan : snapshot.scans) EXPECT_LT(Away(scan.T_keyframe_robot, {}), 1e-9);
}

// The mean of the matches since it stopped goes on where a mapper is loaded again.
TEST(Standstill, IsKept) {
  NoisyScans scans;
  Mapper mapper(MapperOptions{}, {}, 1), loaded(MapperOptions{}, {}, 1);
  const Pose2 stop{0.01, 0.0, 0.0};  // Of odometry, so that the robot no longer is at its start.
  static_cast<void>(mapper.Process(scans.Next(), {}, SerialFor));
  for (int scan = 0; scan < 10; ++scan) static_cast<void>(mapper.Process(scans.Next(), stop, SerialFor));
  StateWriter writer;
  mapper.Save(writer);
  const std::string bytes = writer.Bytes();
  StateReader reader(bytes);
  loaded.Load(reader);
  ASSERT_TRUE(reader.ok()) << reader.failed();
  for (int scan = 0; scan < 10; ++scan) {
    const auto next = scans.Next();
    ASSERT_EQ(loaded.Process(next, stop, SerialFor).T_map_robot, mapper.Process(next, stop, SerialFor).T_map_robot)
        << scan;
  }
}

}  // namespace
}  // namespace cairn::slam
