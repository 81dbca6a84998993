#include "server/slam/site/rival_places.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "tests/server/slam/equal_wings.h"
#include "tests/server/slam/site/site_drives.h"

namespace cairn::slam {
namespace {

using test::FirstOf;
using test::RobotDrive;
using test::StepList;

constexpr double kStepM = 0.4;

// A session has taken over where a job has found it.
MapperSnapshot MovedBy(const Pose2& T_site_own, MapperSnapshot snapshot) {
  for (auto* path : {&snapshot.online_path, &snapshot.full_path})
    for (Pose2& pose : *path) pose = T_site_own * pose;
  return snapshot;
}

RobotDrive DriveWings(const test::World& world, const Pose2& T_world_start, const StepList& way, std::uint64_t seed) {
  test::Laser laser = test::FullTurnLaser();
  laser.range_max_m = 12.0;
  laser.sigma_m = 0.01;
  const Pose2 T_own_start = seed == 1 ? T_world_start : Pose2{5.0, -3.0, 1.0};
  return DriveThrough(world, T_world_start, way.steps(), T_own_start, seed, 0.0002, laser);
}

// A robot that began the map, and one of which nobody knows where it starts. Jobs join them, and look again.
struct TwoInWings {
  RobotDrive first, second;
  RelationBook book{};
  std::optional<Pose2> T_site_second{};  // How the second one's own frame lies in the map, as soon as it is joined.

  std::vector<SmoothedSession> Job(std::size_t of_first, std::size_t of_second, SiteSearch search) {
    book.BeginJob();
    const MapperSnapshot one = FirstOf(first.snapshot, of_first);
    const MapperSnapshot two = MovedBy(T_site_second.value_or(Pose2{}), FirstOf(second.snapshot, of_second));
    const bool joined = T_site_second.has_value();
    auto smoothed = *SmoothSessions(
        std::vector<SiteSession>{{one, true, 4}, {two, joined, 7, joined}}, SiteOptionsOf(MapperOptions{}),
        [](double) { return true; }, search, &book);
    book.EndJob([](std::uint64_t) { return true; });
    if (smoothed[1].joined) T_site_second = smoothed[1].path.front() * second.snapshot.full_path.front().Inverse();
    return smoothed;
  }
  // How far the second one is from where it truly is.
  [[nodiscard]] double Error() const {
    return ((*T_site_second * second.snapshot.full_path.front()).translation() - second.truth.front().translation())
        .norm();
  }
};

constexpr double kWingM = 32.0, kHallM = 76.0;

// The second one has seen the other wing only, and so it is joined where the first one has seen the same.
struct EqualWingsTest : ::testing::Test {
  TwoInWings robots{.first = DriveWings(test::EqualWings(kWingM, kHallM), {},
                                        StepList(kStepM).Ahead(kWingM).Turn(kPi / 2).Ahead(kHallM - 4.0), 1),
                    .second = DriveWings(
                        test::EqualWings(kWingM, kHallM), {kWingM, kHallM, kPi},
                        StepList(kStepM).Ahead(kWingM).Turn(kPi).Ahead(kWingM).Turn(-kPi / 2).Ahead(kHallM - 4.0), 2)};
};

TEST_F(EqualWingsTest, AWrongJoinIsTakenBackWhenMoreIsSeenElsewhere) {
  static_cast<void>(robots.Job(80, 80, SiteSearch::kFragments));
  ASSERT_TRUE(robots.T_site_second);
  ASSERT_GT(robots.Error(), 20.0) << "this is no wrong join";
  const auto smoothed = robots.Job(robots.first.truth.size(), robots.second.truth.size(), SiteSearch::kRobots);
  EXPECT_TRUE(smoothed[1].joined);
  // The paths of both have turned too far by then.
  EXPECT_LT(robots.Error(), 1.0);
  // From then on it stays there.
  static_cast<void>(robots.Job(robots.first.truth.size(), robots.second.truth.size(), SiteSearch::kRobots));
  EXPECT_LT(robots.Error(), 1.0);
}

// Three sessions in a row: how many squares of relations hold them together, and what moves.
TEST(WeakestCut, IsWhereTheFewestRelationsAre) {
  const std::vector<Pose2> steps(40, Pose2{2.0, 0.0, 0.0});
  std::vector<RobotDrive> drives;
  std::vector<std::unique_ptr<SessionMap>> maps;
  std::vector<const SessionMap*> all;
  for (std::uint64_t id = 1; id <= 4; ++id) {
    drives.push_back(test::DriveThrough({}, {}, steps, {}, id, 0.0));
    const MapperSnapshot& snapshot = drives.back().snapshot;
    maps.push_back(std::make_unique<SessionMap>(id, snapshot, snapshot.full_path, SiteOptionsOf(MapperOptions{})));
    all.push_back(maps.back().get());
  }
  SiteGraph graph(all, {true, true, true, true}, PoseGraphOptions{});
  const auto relate = [&graph](std::size_t a, std::size_t b, std::size_t squares) {
    for (std::size_t k = 0; k < squares; ++k)
      for (int again = 0; again < 2; ++again) graph.Add(std::vector<SessionRelation>{{{a, k}, {b, k}, {}}});
  };
  relate(0, 1, 5);
  relate(1, 2, 10);
  const WeakestCut last = WeakestCutBetween(graph, 0, 2, {true, false, false, false});
  EXPECT_EQ(last.squares, 5U);
  EXPECT_EQ(last.moves, (std::vector<bool>{false, true, true, false})) << "what hangs on it goes with it";
  relate(0, 2, 7);
  EXPECT_EQ(WeakestCutBetween(graph, 0, 2, {true, false, false, false}).squares, 12U);
  // The one in the middle stays where somebody has said that it is.
  const WeakestCut from_both = WeakestCutBetween(graph, 0, 2, {true, true, false, false});
  EXPECT_EQ(from_both.squares, 17U);
  EXPECT_EQ(from_both.moves, (std::vector<bool>{false, false, true, false}));
  EXPECT_EQ(WeakestCutBetween(graph, 1, 2, {false, false, true, false}).moves,
            (std::vector<bool>{false, true, false, false}))
      << "15 squares hold the second one, and 17 it and the first one";
}

// They are joined in the hall, and then the second one sees a wing that looks like the one that the first one has seen.
TEST(EqualWings, ARightJoinIsNotTakenBackForAWingThatLooksTheSame) {
  constexpr double kLongWingM = 60.0;
  const test::World world = test::EqualWings(kLongWingM, 44.0);
  TwoInWings robots{.first = DriveWings(world, {}, StepList(kStepM).Ahead(kLongWingM).Turn(kPi / 2).Ahead(40.0), 1),
                    .second = DriveWings(world, {kLongWingM, 6.0, kPi / 2},
                                         StepList(kStepM).Ahead(38.0).Turn(kPi / 2).Ahead(kLongWingM), 2)};
  static_cast<void>(robots.Job(robots.first.truth.size(), 90, SiteSearch::kFragments));
  ASSERT_TRUE(robots.T_site_second);
  for (int i = 0; i < 2; ++i) {
    static_cast<void>(robots.Job(robots.first.truth.size(), robots.second.truth.size(), SiteSearch::kRobots));
    EXPECT_LT(robots.Error(), 0.5);
  }
}

}  // namespace
}  // namespace cairn::slam
