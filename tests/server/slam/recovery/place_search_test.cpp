// Finding a place in a map, and following a robot until it is found, each by itself: the map is a drive round a
// corridor whose niches make no two stretches alike.
#include "server/slam/recovery/place_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "server/slam/mapper_options.h"
#include "server/slam/recovery/recovery.h"
#include "server/slam/scan/beam_points.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

constexpr test::Laser kLaser{.range_max_m = 12.0, .sigma_m = 0.01};

// A hall of 44 x 10 m. Crates of any size and direction on both sides of its middle make no two stretches alike.
test::World Hall(std::uint64_t seed = 3) {
  test::World world = test::Room(-2.0, -5.0, 44.0, 10.0);
  std::mt19937_64 rng(seed);
  std::uniform_real_distribution<double> any(0.0, 1.0);
  for (double x = 0.0; x < 40.0; x += 2.0) {
    for (const double side : {-1.0, 1.0}) {
      const Pose2 T_world_crate{x + any(rng), side * (1.8 + 2.0 * any(rng)), kPi * any(rng)};
      const double length_m = 0.4 + any(rng), width_m = 0.3 + 0.5 * any(rng);
      std::vector<Eigen::Vector2d> corners;
      for (const auto& [u, v] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 1}, {0, 0}})
        corners.push_back((T_world_crate * Pose2{u * length_m, v * width_m, 0.0}).translation());
      world.Add(corners);
    }
  }
  return world;
}

// The map of a drive along the middle: a keyframe every 0.25 m at its true pose.
struct Map {
  Trail trail{MotionNoise{}};
  PosePath path;

  explicit Map(const test::World& world, double from_m = 0.0, double to_m = 38.0) {
    for (double x = from_m; x < to_m; x += 0.25) Add(world, {x, 0, 0}, {x, 0, 0}, true);
  }
  void Add(const test::World& world, const Pose2& truth, const Pose2& T_map_robot, bool localized) {
    Scan scan = test::Look(world, truth, kLaser, &rng);
    std::vector<SurfacePoint> points = SurfacePointsOf(PointsOf(scan), scan, {});
    trail.Append({std::make_shared<const Scan>(std::move(scan)), truth}, truth, std::move(points),
                 Eigen::Matrix3d::Zero(), std::nullopt);
    trail.MarkLast(localized, localized);
    path.Append(T_map_robot);
  }
  std::mt19937_64 rng{5};
  const PlaceSearchOptions options;
  const PathMap searched{trail, path, options, SelfCheckOptions{}.near_m};
};

const Map& MapOfHall() {
  static const Map map(Hall());
  return map;
}

// The scan of a robot that stands there, as RecentScan has it; `T_track_world` is any transform.
RecentScan ScanAt(const test::World& world, const Pose2& truth, const Pose2& T_track_world, double travelled_m,
                  std::mt19937_64& rng) {
  auto scan = std::make_shared<const Scan>(test::Look(world, truth, kLaser, &rng));
  RecentScan recent{scan, T_track_world * truth, travelled_m, {}};
  recent.points = SurfacePointsOf(PointsOf(*scan), *scan, {});
  return recent;
}

// Twelve metres along the middle.
std::vector<RecentScan> Stretch(const test::World& world, double from_m) {
  std::mt19937_64 rng(9);
  std::vector<RecentScan> recent;
  for (double way_m = 0.0; way_m < 12.0; way_m += 0.25)
    recent.push_back(ScanAt(world, {from_m + way_m, 0, 0}, {-70.0, 20.0, 2.0}, way_m, rng));
  return recent;
}

PlaceSearch Search() {
  const MapperOptions options;
  return {options.recovery.place, options.loop, options.self_check, options.front_end.refine};
}

TEST(PlaceSearch, FindsWhereTheRobotIsInTheWholeMap) {
  PlaceSearch search = Search();
  for (const double from_m : {8.0, 25.0}) {
    const auto found = search.Find(MapOfHall().searched, Stretch(Hall(), from_m));
    ASSERT_TRUE(found) << from_m;
    EXPECT_NEAR(found->T_map_robot.x, from_m + 11.75, 0.05);
    EXPECT_NEAR(found->T_map_robot.y, 0.0, 0.05);
    EXPECT_NEAR(found->T_map_robot.theta, 0.0, 0.01);
    const double sigma_m = LoopOptions{}.sigma_m;
    EXPECT_GE(found->covariance(0, 0), sigma_m * sigma_m);
    EXPECT_LT(found->covariance(0, 0), 4.0 * sigma_m * sigma_m);
  }
}

TEST(PlaceSearch, APlaceWithoutAMapOrInAnotherWorldIsNotFound) {
  PlaceSearch search = Search();
  EXPECT_FALSE(search.Find(MapOfHall().searched, {}));
  EXPECT_FALSE(search.Find(MapOfHall().searched, Stretch(Hall(4), 8.0)));
}

TEST(PlaceSearch, WhereRoomsLookAlikeNoneOfThemIsFound) {
  const test::World world = test::RingOfEqualRooms();
  const Map map(world, 0.0, 30.0);
  PlaceSearch search = Search();
  EXPECT_FALSE(search.Find(map.searched, Stretch(world, 12.0)));
}

// Everything else fits, but beams pass where the map shows a wall.
TEST(PlaceSearch, APlaceThatTheScansContradictIsNotFound) {
  test::World before = Hall();
  before.Add({{12.0, -1.0}, {18.0, -1.0}});  // A wall that is gone now.
  const Map map(before);
  PlaceSearch search = Search();
  EXPECT_TRUE(search.Find(map.searched, Stretch(before, 8.0)));
  EXPECT_FALSE(search.Find(map.searched, Stretch(Hall(), 8.0)));
}

// Keyframes whose place is not known are no part of the map.
TEST(PlaceSearch, KeyframesThatAreNotLocalizedDoNotCount) {
  Map map(Hall(), 30.0);
  for (double x = 4.0; x < 22.0; x += 0.25) map.Add(Hall(), {x, 0, 0}, {x, 3.0, 0.0}, false);
  PlaceSearch search = Search();
  EXPECT_FALSE(search.Find(map.searched, Stretch(Hall(), 9.0)));
}

TEST(PlaceSearch, AScanAgreesWithTheMapContradictsItOrSeesNothingOfIt) {
  using Agreement = PlaceSearch::Agreement;
  std::mt19937_64 rng(9);
  const RecentScan scan = ScanAt(Hall(), {12, 0, 0}, {}, 0.0, rng);
  const PlaceSearch search = Search();
  const auto at = [&](const Pose2& T_map_robot) {
    return search.Compare(MapOfHall().searched, *scan.scan, scan.points, T_map_robot);
  };
  EXPECT_EQ(at({12, 0, 0}), Agreement::kAgrees);
  EXPECT_EQ(at({12, 0.05, 0.01}), Agreement::kAgrees);
  EXPECT_EQ(at({12, 1.0, 0.5}), Agreement::kContradicts);
  EXPECT_EQ(at({12, 60, 0}), Agreement::kNothingNear);
}

// A robot that is not watched any more at this place.
class Lost : public ::testing::Test {
 protected:
  static Recovery Make() {
    const MapperOptions options;
    return {options.recovery, options.loop, options.self_check,  options.front_end.refine, options.front_end.surface,
            options.blind,    true,         options.lost_after_m};
  }
  static Recovery::Known KnownAt(double x) {
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    covariance.diagonal() << 0.04, 0.01, 0.001;
    return {{x, 0, 0}, {5, 5, kPi / 2}, covariance};
  }
  // The robot stands at `truth`, `odometry` beyond the odometry of KnownAt.
  std::optional<Recovery::Found> Take(Recovery& recovery, const Pose2& truth, const Pose2& odometry,
                                      const SearchedMap& own = MapOfHall().searched) {
    const RecentScan scan = ScanAt(world_, truth, T_track_world_, 0.0, rng_);
    TrackStep step;
    step.T_track_robot = scan.T_track_robot;
    step.matched = true;
    return recovery.Take({scan.scan, KnownAt(0).T_odom_robot * odometry}, step, scan.points, own);
  }

  // The way along the middle after which a robot that is followed with an error is found; far more if at a wrong place.
  double FoundAfter(const Map& map) {
    Recovery recovery = Make();
    recovery.BeginNear(KnownAt(0), Pose2{0.6, 0.0, 0.0} * T_track_world_.Inverse());
    for (double way_m = 4.0; way_m < 37.0; way_m += 0.25) {
      const auto found = Take(recovery, {way_m, 0, 0}, {way_m, 0, 0}, map.searched);
      if (found) return std::abs(found->place.T_map_robot.x - way_m) < 0.05 ? way_m : 2000.0;
    }
    return 1000.0;
  }
  const test::World world_ = Hall();
  const Pose2 T_track_world_{3.0, -4.0, 1.0};
  std::mt19937_64 rng_{9};
};

TEST_F(Lost, OdometryCarriesThePoseWithItsDoubtUntilTheWayIsTooLong) {
  Recovery recovery = Make();
  recovery.Begin(KnownAt(10), true);
  const auto after = [&](const Pose2& moved) { return recovery.BeliefAt(KnownAt(10).T_odom_robot * moved, {}); };
  const Recovery::Belief at_once = after({}), later = after({1.5, 0, 0}), far = after({2.5, 0, 0});
  EXPECT_NEAR(at_once.covariance(0, 0), 0.04, 1e-4);
  EXPECT_NEAR(at_once.covariance(1, 1), 0.01, 1e-4);
  EXPECT_NEAR(later.T_map_robot.x, 11.5, 1e-9);
  EXPECT_NEAR(later.T_map_robot.y, 0.0, 1e-9);
  EXPECT_EQ(later.reason, PoseReason::kOdometryOnly);
  // What was known, what its heading adds on the way, and the noise of odometry.
  const Eigen::Matrix3d noise = MapperOptions{}.blind.Covariance({1.5, 0, 0});
  EXPECT_NEAR(later.covariance(0, 0), 0.04 + noise(0, 0), 1e-9);
  EXPECT_NEAR(later.covariance(1, 1), 0.01 + 1.5 * 1.5 * 0.001 + noise(1, 1), 1e-9);
  EXPECT_EQ(far.reason, PoseReason::kLost);
  recovery.OdometryBeganAnew();
  EXPECT_EQ(after({}).reason, PoseReason::kLost);
  EXPECT_GT(after({}).covariance(0, 0), 1e5);
}

TEST_F(Lost, OnThePathTheScansCarryThePose) {
  Recovery recovery = Make();
  recovery.BeginOnPath(KnownAt(10), {7.0, 1.0, 0.5});
  const Pose2 T_track_robot{1.0, 2.0, 0.25};
  EXPECT_EQ(recovery.BeliefAt(KnownAt(10).T_odom_robot, T_track_robot).T_map_robot,
            (Pose2{7.0, 1.0, 0.5} * T_track_robot));
}

TEST_F(Lost, AScanThatContradictsTheMapTakesTheRobotOffItsPath) {
  for (const bool moved : {false, true}) {
    Recovery recovery = Make();
    recovery.BeginOnPath(KnownAt(10), T_track_world_.Inverse());
    // The map where the scans have carried the pose, and another place.
    const Pose2 truth = moved ? Pose2{20.0, 0.6, 0.7} : Pose2{10, 0, 0};
    std::mt19937_64 rng(9);
    const RecentScan scan = ScanAt(world_, truth, {}, 0.0, rng);
    TrackStep step;
    step.matched = true;
    step.T_track_robot = T_track_world_ * Pose2{10, 0, 0};
    EXPECT_FALSE(recovery.Take({scan.scan, KnownAt(10).T_odom_robot}, step, scan.points, MapOfHall().searched));
    EXPECT_EQ(recovery.on_path(), !moved);
    EXPECT_EQ(recovery.BeliefAt(KnownAt(10).T_odom_robot, step.T_track_robot).reason,
              moved ? PoseReason::kLost : PoseReason::kOdometryOnly);
  }
}

TEST_F(Lost, IsFoundByTwoSearchesThatAgreeWithSomeWayBetweenThem) {
  Recovery recovery = Make();
  recovery.Begin(KnownAt(30), false);
  std::optional<double> found_m;
  for (double way_m = 0.0; way_m < 15.0 && !found_m; way_m += 0.25) {
    const auto found = Take(recovery, {8.0 + way_m, 0, 0}, {way_m, 0, 0});
    if (!found) continue;
    found_m = way_m;
    EXPECT_NEAR(found->place.T_map_robot.x, 8.0 + way_m, 0.05);
    EXPECT_FALSE(found->on_path);
  }
  ASSERT_TRUE(found_m);
  EXPECT_GE(*found_m, LoopOptions{}.confirm_after_m);
}

// A search is done in parts, and what it has found is looked at with the scan after its last part. A restart between
// any two scans changes nothing.
TEST_F(Lost, IsFoundWithTheSameScanAfterARestart) {
  Recovery recovery = Make();
  recovery.Begin(KnownAt(30), false);
  std::optional<Recovery::Found> found, again;
  int searching = 0;  // Restarts during a search.
  for (double way_m = 0.0; way_m < 15.0 && !found; way_m += 0.25) {
    StateWriter writer;
    writer(recovery);
    const std::string bytes = writer.Bytes();
    StateReader reader(bytes);
    Recovery restored = Make();
    reader(restored);
    ASSERT_TRUE(reader.done());
    const RecentScan scan = ScanAt(world_, {8.0 + way_m, 0, 0}, T_track_world_, 0.0, rng_);
    TrackStep step;
    step.T_track_robot = scan.T_track_robot;
    step.matched = true;
    const auto take = [&](Recovery& by) {
      return by.Take({scan.scan, KnownAt(0).T_odom_robot}, step, scan.points, MapOfHall().searched);
    };
    again = take(restored);
    found = take(recovery);
    ASSERT_EQ(again.has_value(), found.has_value()) << way_m;
    searching += recovery.Unconfirmed().empty() ? 1 : 0;
  }
  ASSERT_TRUE(found);
  EXPECT_GE(searching, 2);
  EXPECT_EQ(again->place.T_map_robot, found->place.T_map_robot);
}

TEST_F(Lost, WhereItIsSaidToBeOneSearchIsEnough) {
  for (const double said_x : {8.6, 12.0}) {
    Recovery recovery = Make();
    recovery.BeginWhereSaid(KnownAt(said_x));
    const auto found = Take(recovery, {8.0, 0, 0}, {});
    ASSERT_EQ(found.has_value(), said_x < 10.0);
    if (found) {
      EXPECT_NEAR(found->place.T_map_robot.x, 8.0, 0.05);
    }
  }
}

// What a job finds is a place in another map: here the same hall, 50 m away. All scans have the same stamp, so the job
// has seen the first one.
class Suggested : public Lost {
 protected:
  Suggested() {
    nothing_.Add(world_, {30, 0, 0}, {30, 0, 0}, false);
    for (double x = 0.0; x < 38.0; x += 0.25) there_.Add(world_, {x, 0, 0}, {x, 50, 0}, true);
    recovery_.Begin(KnownAt(30), false);
  }
  std::optional<Recovery::Found> DriveTo(double way_m, const Map& own) {
    return Take(recovery_, {8.0 + way_m, 0, 0}, {way_m, 0, 0}, own.searched);
  }
  bool Suggest(const Map& map) {
    const std::shared_ptr<const SearchedMap> not_owned(std::shared_ptr<void>(), &map.searched);
    return recovery_.Suggest(recovery_.recent().front().scan->stamp, {8, 50, 0}, not_owned);
  }

  Map nothing_{world_, 0.0, 0.0}, there_{world_, 0.0, 0.0};
  Recovery recovery_ = Make();
};

TEST_F(Suggested, APlaceIsConfirmedInTheMapOfTheJobAfterSomeWay) {
  ASSERT_FALSE(DriveTo(0.0, nothing_));
  ASSERT_TRUE(Suggest(there_));
  std::optional<double> found_m;
  for (double way_m = 0.25; way_m < 8.0 && !found_m; way_m += 0.25) {
    const auto found = DriveTo(way_m, nothing_);
    if (!found) continue;
    found_m = way_m;
    EXPECT_NEAR(found->place.T_map_robot.x, 8.0 + way_m, 0.05);
    EXPECT_NEAR(found->place.T_map_robot.y, 50.0, 0.05);
  }
  ASSERT_TRUE(found_m);
  EXPECT_GE(*found_m, LoopOptions{}.confirm_after_m);
}

TEST_F(Suggested, APlaceThatTheOwnMapContradictsCountsNoMore) {
  ASSERT_FALSE(DriveTo(0.0, nothing_));
  recovery_.ForgetMap();  // Its own map is that of the hall from now on.
  ASSERT_TRUE(Suggest(nothing_));
  bool found = false;
  for (double way_m = 0.25; way_m < 15.0 && !found; way_m += 0.25) found = DriveTo(way_m, MapOfHall()).has_value();
  EXPECT_TRUE(found);
  EXPECT_FALSE(recovery_.suggested());
}

TEST_F(Suggested, APlaceIsNotTakenWhereTheRobotHasJustFoundAnother) {
  for (double way_m = 0.0; way_m < 15.0 && recovery_.Unconfirmed().empty(); way_m += 0.25)
    ASSERT_FALSE(DriveTo(way_m, MapOfHall()));
  ASSERT_FALSE(recovery_.Unconfirmed().empty());
  EXPECT_FALSE(Suggest(there_));
  EXPECT_FALSE(recovery_.suggested());
}

TEST_F(Lost, OnlyPlacesThatAreTheSameConfirmEachOther) {
  const Pose2 place{4.0, 2.0, 3.1};
  EXPECT_TRUE(ConfirmEachOther(place, {4.3, 2.3, 3.1}));
  EXPECT_FALSE(ConfirmEachOther(place, {4.4, 2.4, 3.1}));
  EXPECT_TRUE(ConfirmEachOther(place, {4.0, 2.0, -kPi + 0.01}));
  EXPECT_FALSE(ConfirmEachOther(place, {4.0, 2.0, -kPi + 0.05}));
}

// A robot that drives far where its map shows nothing, so fast that one search follows the other. What it saw long ago
// would keep it from being found where it comes into its map again.
TEST_F(Lost, IsLookedForWithTheLastStretchOnly) {
  const test::World other = Hall(11);
  Recovery recovery = Make();
  recovery.Begin(KnownAt(10), false);
  for (double way_m = 0.0; way_m < 100.0; way_m += 1.0) {
    const double x = std::abs(std::remainder(way_m, 2.0 * 38.0));
    const RecentScan scan = ScanAt(other, {x, 0, 0}, T_track_world_, 0.0, rng_);
    TrackStep step;
    step.T_track_robot = scan.T_track_robot;
    step.matched = true;
    EXPECT_FALSE(recovery.Take({scan.scan, {}}, step, scan.points, MapOfHall().searched)) << way_m;
    const double kept_m = recovery.recent().back().travelled_m - recovery.recent().front().travelled_m;
    ASSERT_LE(kept_m, kStretchM + 10.0) << way_m;  // A search takes some scans.
  }
}

// A robot that is followed from where its map shows nothing back into it, with an error that one search cannot prove.
TEST_F(Lost, WhereTheTrackComesBackIntoTheMapTheRobotIsFoundWithWhatItSawLast) {
  EXPECT_LT(FoundAfter(Map(world_, 22.0)), 27.0);  // 9 m later with the whole stretch alone.
  // With a metre of the way in the map: never, if a place must explain most of what the robot sees.
  EXPECT_LT(FoundAfter(Map(world_, 20.0, 21.0)), 23.0);
}

// A robot that turns on one spot for an hour.
TEST_F(Lost, KeepsABoundedNumberOfScans) {
  const auto bytes_after = [&](int scans) {
    Recovery recovery = Make();
    recovery.Begin(KnownAt(10), true);
    for (int i = 0; i < scans; ++i) {
      const RecentScan scan = ScanAt(world_, {60, 60, 0}, {}, 0.0, rng_);
      TrackStep step;
      static_cast<void>(recovery.Take({scan.scan, {}}, step, scan.points, MapOfHall().searched));
    }
    StateWriter writer;
    writer(recovery);
    return writer.Bytes().size();
  };
  EXPECT_EQ(bytes_after(150), bytes_after(300));
}

}  // namespace
}  // namespace cairn::slam
