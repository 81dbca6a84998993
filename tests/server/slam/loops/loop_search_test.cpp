#include "server/slam/loops/loop_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "server/slam/loops/one_per_cell.h"
#include "server/slam/loops/stretch_match.h"
#include "server/slam/state/archive.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::RingCorridor;
using test::RingSteps;
using test::World;

// A robot that drives round the ring, tracked by a front-end that turns a little too far with every metre.
struct Drive {
  Trail trail{MotionNoise{0.002, 0.01, 0.005, 0.0005, 0.002, 0.005}};
  std::vector<Pose2> truth;
  PosePath believed;

  void Step(const World& world, const Pose2& motion, double drift_rad, std::mt19937_64& rng, double slip_m = 0.0) {
    const Pose2 seen = motion * Pose2{slip_m, 0, drift_rad};
    const bool first = truth.empty();
    truth.push_back(first ? Pose2{} : truth.back() * motion);
    const Pose2 T_track_robot = first ? Pose2{} : trail.shapes().back().T_track_robot * seen;
    auto scan = std::make_shared<const Scan>(
        Look(world, truth.back(), Laser{.first_rad = -kPi / 2, .range_max_m = 12.0, .sigma_m = 0.01}, &rng));
    trail.Append({scan, T_track_robot}, T_track_robot, SurfacePointsOf(PointsOf(*scan), *scan, {}),
                 Eigen::Matrix3d::Zero(), std::nullopt);
    believed.Append(T_track_robot);
  }
};

// The drives differ in the noise of the laser, in how much the front-end turns too far and to which side, and
// in how far it slips forwards or back on the far long side. The error of the believed pose stays within the
// search region.
struct Ride {
  std::uint64_t seed = 0;
  double drift_rad_per_m = 0.0;
  double slip_m = 0.0;
};
constexpr Ride kRides[] = {{1, 0.0015, 0.0}, {2, -0.0015, 0.0}, {3, 0.0005, 2.0}, {4, -0.0005, -2.0}};

// Drives `metres` along the ring and searches from `from_m` on. From there on the world is `later`, if given.
std::optional<LoopClosure> DriveUntilFound(Drive& drive, const World& world, double metres, const Ride& ride,
                                           double from_m = 0.0, const LoopOptions& options = {},
                                           const World* later = nullptr) {
  LoopSearch search(options, {});
  std::mt19937_64 rng(ride.seed);
  double way_m = 0.0;
  for (const Pose2& step : RingSteps(metres, 0.4)) {
    drive.Step(later != nullptr && way_m >= from_m ? *later : world, step, ride.drift_rad_per_m * step.x, rng,
               way_m < 70.0 && way_m + step.x >= 70.0 ? ride.slip_m : 0.0);
    way_m += step.x;
    if (way_m < from_m) continue;
    if (const auto loop = search.Find(drive.trail, drive.believed)) return loop;
    // Other scans follow on each keyframe, enough for a comparison.
    while (search.busy())
      if (const auto loop = search.GoOn(drive.trail)) return loop;
  }
  return std::nullopt;
}

void ExpectRight(const Drive& drive, const LoopClosure& found) {
  const Pose2 truth = Between(drive.truth[found.old], drive.truth[found.recent]);
  EXPECT_LT((found.T_old_recent.translation() - truth.translation()).norm(), 0.15);
  EXPECT_LT(std::abs(AngleDiff(found.T_old_recent.theta, truth.theta)), 0.02);
  EXPECT_TRUE(IsCovariance(found.covariance));
}

TEST(LoopSearch, FindsTheStartAfterTheRoundAlthoughItSeemsFarAway) {
  double farthest_m = 0.0;
  for (const Ride& ride : kRides) {
    SCOPED_TRACE(ride.seed);
    Drive drive;
    const auto found = DriveUntilFound(drive, RingCorridor(true, 10 + ride.seed), 150.0, ride);
    ASSERT_TRUE(found);
    ExpectRight(drive, *found);
    const Pose2 truth = Between(drive.truth[found->old], drive.truth[found->recent]);
    const Pose2 believed = Between(drive.believed[found->old], drive.believed[found->recent]);
    farthest_m = std::max(farthest_m, (believed.translation() - truth.translation()).norm());
  }
  EXPECT_GT(farthest_m, 1.5) << "the drift must be worth a search";
}

TEST(LoopSearch, FindsNothingWhereTheRobotHasNotBeen) {
  for (const Ride& ride : kRides) {
    Drive drive;
    EXPECT_FALSE(DriveUntilFound(drive, RingCorridor(true, 10 + ride.seed), 100.0, ride)) << ride.seed;
  }
}

// After one round, the metres 130 to 148 of the path lie on the first side again, and the last 15 m show no
// corner.
constexpr double kOnTheFirstSideM = 130.0, kBeforeTheNextCornerM = 146.0;
constexpr double kInKnownCorridorM = 126.0;

TEST(LoopSearch, ABareCorridorFitsAnywhereAndIsNotBelieved) {
  for (const Ride& ride : kRides) {
    Drive drive;
    EXPECT_FALSE(DriveUntilFound(drive, RingCorridor(false), kBeforeTheNextCornerM, ride, kOnTheFirstSideM))
        << ride.seed;
  }
}

// Even if another place may fit as well: a bare corridor does not show where along it the robot is.
TEST(LoopSearch, ABareCorridorIsNotBelievedWhateverElseFits) {
  LoopOptions options;
  options.max_rival = 1.0;
  Drive drive;
  EXPECT_FALSE(DriveUntilFound(drive, RingCorridor(false), 138.0, kRides[0], kOnTheFirstSideM, options));
}

// On the second round boxes stand where the beams of the first round have passed. The niches still fit.
TEST(LoopSearch, APlaceWhereThingsStandInFormerlyFreeSpaceIsAnother) {
  const World empty = RingCorridor(true);
  World furnished = empty;
  for (double x = 0.5; x < 38.0; x += 1.5)
    furnished.Add({{x, 0.6}, {x + 0.5, 0.6}, {x + 0.5, 1.0}, {x, 1.0}, {x, 0.6}});
  LoopOptions options;
  for (const bool conflicts_count : {true, false}) {
    options.max_conflict = conflicts_count ? 0.1 : 1.0;
    Drive drive;
    const auto found = DriveUntilFound(drive, empty, 150.0, kRides[0], 112.0, options, &furnished);
    EXPECT_EQ(found.has_value(), !conflicts_count);
    if (found) ExpectRight(drive, *found);
  }
}

// A corner of the bare corridor, or the end of the row of equal rooms, determines where the robot is. An
// accepted loop must be right there, although nearly everything also fits one room further on, 4 m beside the
// right place.
TEST(LoopSearch, ClosesNoLoopAtTheWrongCornerOrTheWrongOneOfEqualRooms) {
  for (const Ride& ride : kRides) {
    for (const bool rooms : {false, true}) {
      SCOPED_TRACE(std::to_string(ride.seed) + (rooms ? " rooms" : " bare"));
      Drive drive;
      const auto found = DriveUntilFound(drive, rooms ? test::RingOfEqualRooms() : RingCorridor(false), 190.0, ride);
      ASSERT_TRUE(found) << "a search that finds nothing would close no wrong loop either";
      ExpectRight(drive, *found);
    }
  }
}

// The search begins at the end of 14 m that were seen before, and from there on everything looks different. The next
// stretches of 15 m still show mostly those 14 m, and confirmed the first one, although all that they have in common
// with the old place are the same scans.
TEST(LoopSearch, TheSameScansDoNotConfirmALoop) {
  for (const Ride& ride : kRides) {
    SCOPED_TRACE(ride.seed);
    const World old = RingCorridor(true, 10 + ride.seed), other = RingCorridor(true, 50 + ride.seed);
    for (const bool the_same : {false, true}) {
      Drive drive;
      const auto found = DriveUntilFound(drive, old, 140.0, ride, kInKnownCorridorM, {}, the_same ? &old : &other);
      EXPECT_EQ(found.has_value(), the_same);
      if (found) ExpectRight(drive, *found);
    }
  }
}

std::string StateOf(const LoopSearch& search) {
  StateWriter writer;
  writer(search);
  return writer.Bytes();
}

// A search is done in parts, one with each scan. A restart before any of them changes nothing, also in the middle of a
// comparison.
TEST(LoopSearch, GoesOnAfterARestart) {
  const World world = RingCorridor(true, 11);
  auto search = std::make_unique<LoopSearch>(LoopOptions{}, PointToLineOptions{});
  Drive drive;
  std::mt19937_64 rng(1);
  std::optional<LoopClosure> found;
  int restarts_in_comparisons = 0;
  double way_m = 0.0;
  for (const Pose2& step : RingSteps(150.0, 0.4)) {
    drive.Step(world, step, 0.0015 * step.x, rng);
    way_m += step.x;
    for (const bool keyframe : {true, false}) {  // Each keyframe is followed by another scan.
      if (way_m < 112.0 || found) continue;
      auto restored = std::make_unique<LoopSearch>(LoopOptions{}, PointToLineOptions{});
      const std::string state = StateOf(*search);
      StateReader reader(state);
      reader.SetKeyframes(drive.trail.size());
      reader(*restored);
      ASSERT_TRUE(reader.done());
      restarts_in_comparisons += search->busy() ? 1 : 0;
      const auto scan = [&](LoopSearch& of) {
        return keyframe ? of.Find(drive.trail, drive.believed) : of.GoOn(drive.trail);
      };
      found = scan(*search);
      const auto again = scan(*restored);
      ASSERT_EQ(again.has_value(), found.has_value()) << drive.trail.size();
      ASSERT_EQ(StateOf(*search), StateOf(*restored)) << drive.trail.size();
      if (!found) continue;
      EXPECT_EQ(again->T_old_recent, found->T_old_recent);
      EXPECT_EQ(again->old, found->old);
      EXPECT_EQ(found->recent, drive.trail.size() - 1);
    }
    if (found) break;
  }
  ASSERT_TRUE(found);
  ExpectRight(drive, *found);
  EXPECT_GT(restarts_in_comparisons, 10);
}

// What a comparison finds does not depend on how it is cut, and a smaller part does less.
TEST(StretchMatch, FindsTheSameInParts) {
  const Ride& ride = kRides[0];
  Drive drive;
  DriveUntilFound(drive, RingCorridor(true, 11), 132.0, ride, 1e9);
  const std::span<const KeyframeShape> shapes = drive.trail.shapes();
  const std::size_t now = shapes.size() - 1;
  const Stretch recent = StretchAround(shapes, now, kStretchM);
  const auto old_end =
      std::ranges::upper_bound(shapes, shapes[now].travelled_m - 112.0, {}, &KeyframeShape::travelled_m);
  const Stretch old =
      StretchAround(shapes.first(recent.first), static_cast<std::size_t>(old_end - shapes.begin()), kStretchM);
  const LoopOptions options;
  const SearchWindow window = WindowAround(Between(drive.believed[old.anchor], drive.believed[now]), 112.0, options);
  const auto whole = MatchStretches(drive.trail, old, drive.trail, recent, window, options, {});
  ASSERT_TRUE(whole);
  int fewer = 0;
  for (const int blocks : {1'000'000, 1'000, 200}) {
    StretchMatch match(drive.trail, old, drive.trail, recent, window, options.max_rival);
    int parts = 1;
    while (!match.GoOn(drive.trail, drive.trail, blocks, options, {})) ++parts;
    ASSERT_TRUE(match.found());
    EXPECT_EQ(*match.found(), *whole) << blocks;
    EXPECT_GT(parts, fewer) << blocks;
    fewer = parts;
  }
}

// Drives until a loop is closed, and forgets with keyframe `lost_at`. Returns the number of the last keyframe.
std::size_t ClosedAt(std::size_t lost_at) {
  const World world = RingCorridor(true, 11);
  LoopSearch search({}, {});
  Drive drive;
  std::mt19937_64 rng(1);
  double way_m = 0.0;
  for (const Pose2& step : RingSteps(150.0, 0.4)) {
    drive.Step(world, step, 0.0015 * step.x, rng);
    way_m += step.x;
    if (way_m < 112.0) continue;
    if (drive.trail.size() == lost_at) search.ForgetUnconfirmed();
    bool closed = search.Find(drive.trail, drive.believed).has_value();
    while (search.busy() && !closed) closed = search.GoOn(drive.trail).has_value();
    if (closed) return drive.trail.size();
  }
  return 0;
}

TEST(LoopSearch, WhatWasFoundBeforeTheRobotWasLostClosesNoLoop) {
  const std::size_t otherwise = ClosedAt(0);
  ASSERT_GT(otherwise, 0U);
  // Without what it has found before, it needs 1.5 m from one comparison to the next.
  EXPECT_GE(ClosedAt(otherwise - 2), otherwise + 4);
}

// Its stretches are no longer what they were when it began.
TEST(LoopSearch, WhatIsBeingComparedIsForgottenWhereKeyframesAreRetired) {
  const World world = RingCorridor(true, 11);
  LoopSearch search({}, {});
  Drive drive;
  std::mt19937_64 rng(1);
  double way_m = 0.0;
  for (const Pose2& step : RingSteps(150.0, 0.4)) {
    drive.Step(world, step, 0.0015 * step.x, rng);
    way_m += step.x;
    if (way_m < 112.0) continue;
    ASSERT_FALSE(search.Find(drive.trail, drive.believed));
    if (search.busy()) break;
  }
  ASSERT_TRUE(search.busy());
  Retirement none;
  for (std::size_t k = 0; k < drive.trail.size(); ++k) {
    none.representative.push_back(k);
    none.index_after.push_back(k);
  }
  search.Retire(none);
  EXPECT_FALSE(search.busy());
}

TEST(OnePerCell, TakesTheFirstPointOfEachCell) {
  OnePerCell cells(0.1);
  std::set<std::pair<std::int64_t, std::int64_t>> taken;
  std::mt19937_64 rng(2);
  std::uniform_real_distribution<double> any(-4.0, 4.0);
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector2d p(any(rng), any(rng));
    const auto number = [](double v) { return static_cast<std::int64_t>(std::floor(v / 0.1)); };
    ASSERT_EQ(cells.Takes(p), taken.emplace(number(p.x()), number(p.y())).second) << i;
  }
  EXPECT_GT(taken.size(), 2000U) << "more than its memory held at first";
}

TEST(LoopSearch, CanBeSwitchedOff) {
  Drive drive;
  LoopOptions off;
  off.enabled = false;
  LoopSearch search(off, {});
  std::mt19937_64 rng(1);
  drive.Step(RingCorridor(true), {}, 0.0, rng);
  EXPECT_FALSE(search.Find(drive.trail, drive.believed));
}

TEST(FreeSpace, ContradictsOnlyWhatBeamsWentThrough) {
  Drive drive;
  std::mt19937_64 rng(1);
  drive.Step(test::Room(-4, -4, 8, 8), {}, 0.0, rng);
  const FreeSpace space(drive.trail, {0, 0, 0}, 0.2);
  EXPECT_TRUE(space.Contradicts({2.0, 0.0}));
  EXPECT_FALSE(space.Contradicts({4.0, 0.0}));   // The wall itself.
  EXPECT_FALSE(space.Contradicts({6.0, 0.0}));   // Behind it.
  EXPECT_FALSE(space.Contradicts({-2.0, 0.0}));  // Behind the robot: never seen.
  EXPECT_FALSE(space.Contradicts({1e6, -1e6}));
}

}  // namespace
}  // namespace cairn::slam
