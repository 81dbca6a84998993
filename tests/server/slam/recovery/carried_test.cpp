// Robots that somebody carries between two scans while nothing is missing in what they send, and robots that only look
// so for a moment.
#include "server/slam/recovery/carried.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "server/slam/recovery/recovery.h"
#include "server/slam/scan/beam_points.h"
#include "server/slam/scan_pipeline.h"
#include "tests/server/slam/known_grid_of.h"
#include "tests/server/slam/ring_world.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::Look;
using test::World;

constexpr Laser kTenthOfASecond{.beams = 181, .step_rad = Radians(1.5), .sigma_m = 0.01};

// Drives round in a room of 27 x 10 m with shelves along its walls, a quarter of a metre a scan. Nobody tells it of
// being carried.
class CarriedRobot {
 public:
  CarriedRobot() : pipeline_(std::make_unique<ScanPipeline>(Options(), Pose2{}, SerialFor, Sink())) {
    room_.Add({{4, 5}, {4, 4.2}, {5, 4.2}, {5, 5}});
    room_.Add({{8, -5}, {8, -4}, {8.5, -4}, {8.5, -5}});
    room_.Add({{14, -5}, {14, -2}, {16, -2}, {16, -5}});
  }
  // In another place, with a lidar that sees this far.
  CarriedRobot(World place, double range_max_m)
      : room_(std::move(place)), pipeline_(std::make_unique<ScanPipeline>(Options(), Pose2{}, SerialFor, Sink())) {
    laser_.range_max_m = range_max_m;
  }
  void Follow(const std::vector<Pose2>& steps) {
    for (const Pose2& step : steps) Move(step, {});
  }
  // `others` stands in the room as well.
  void Drive(int scans, const World& others = {}) {
    for (int i = 0; i < scans; ++i) Move({0.25, 0, truth_.x > 19.0 || truth_.x < 0.0 ? 0.15 : 0.0}, others);
  }
  void TurnOnTheSpot(int scans, const World& others) {
    for (int i = 0; i < scans; ++i) Move({0, 0, 0.25}, others);
  }
  void Carry(const Pose2& T_world_robot) { truth_ = before_ = T_world_robot; }
  void CarryAlong(double way_m) { Carry(truth_ * Pose2{way_m, 0, 0}); }
  [[nodiscard]] double ErrorM() const { return (last.T_map_robot.translation() - truth_.translation()).norm(); }
  [[nodiscard]] std::string Save() const {
    std::string bytes;
    pipeline_->Save(bytes);
    return bytes;
  }
  void GoOnFrom(const std::string& state) {
    pipeline_ = std::make_unique<ScanPipeline>(Options(), Pose2{}, SerialFor, Sink());
    ASSERT_TRUE(pipeline_->Load(state));
  }
  [[nodiscard]] const Mapper& mapper() const { return pipeline_->mapper(); }
  // In the map of another robot that has begun at the same place.
  void BeOnlyLocalisedIn(const CarriedRobot& other) {
    ASSERT_TRUE(pipeline_->mapper().LocaliseIn(test::KnownGridOf(other.mapper().grid()), true));
  }

  ScanOutcome last;
  int not_localized = 0, wrong = 0;

 private:
  void Move(const Pose2& step, const World& others) {
    World seen = room_;
    seen.walls.insert(seen.walls.end(), others.walls.begin(), others.walls.end());
    truth_ = truth_ * step;
    odometry_ = odometry_ * Between(before_, truth_);
    before_ = truth_;
    Scan scan = Look(seen, truth_, laser_, &rng_);
    scan.stamp = (++stamp_) * kNanosPerSecond / 5;
    pipeline_->Add(Odometry{0, scan.stamp, odometry_});
    pipeline_->Add(std::make_shared<const Scan>(std::move(scan)));
  }
  static MapperOptions Options() {
    MapperOptions options;
    options.filter.particles = 10;
    return options;
  }
  ScanPipeline::Sink Sink() {
    return {.used =
                [this](const Scan&, const ScanOutcome& outcome) {
                  last = outcome;
                  not_localized += outcome.localized ? 0 : 1;
                  wrong += outcome.localized && ErrorM() > 1.0 ? 1 : 0;
                },
            .dropped = [](const Scan&, DropReason) {}};
  }

  World room_ = test::Room(-3, -5, 27, 10);
  Laser laser_ = kTenthOfASecond;
  Pose2 truth_, before_, odometry_;
  Stamp stamp_ = 0;
  std::mt19937_64 rng_{4};
  std::unique_ptr<ScanPipeline> pipeline_;
};

TEST(CarriedUnseen, ARobotIsNotLocalizedFromTheFirstScanOnUntilItIsFoundInItsMap) {
  CarriedRobot robot;
  robot.Drive(140);
  ASSERT_EQ(robot.not_localized, 0);
  robot.Carry({3.0, 0.5, 0.0});
  robot.Drive(1);
  EXPECT_FALSE(robot.last.localized);
  EXPECT_EQ(robot.last.reason, PoseReason::kOdometryOnly);
  robot.Drive(40);
  EXPECT_EQ(robot.wrong, 0);
  EXPECT_TRUE(robot.last.localized);
  EXPECT_LT(robot.ErrorM(), 0.3);
}

TEST(CarriedUnseen, ARobotThatIsDoubtedIsTheSameAfterACheckpointToTheLastBit) {
  CarriedRobot whole, stopped;
  for (CarriedRobot* const robot : {&whole, &stopped}) {
    robot->Drive(140);
    robot->Carry({3.0, 0.5, 0.0});
  }
  whole.Drive(6);
  for (int i = 0; i < 6; ++i) {
    stopped.Drive(1);
    stopped.GoOnFrom(stopped.Save());
  }
  EXPECT_TRUE(whole.Save() == stopped.Save());
}

// A panel that people carry across hides half of the room, and is elsewhere in every scan.
TEST(CarriedUnseen, ARobotThatSomethingLargePassesIsLocalizedAgainAndLosesNothing) {
  CarriedRobot robot, undisturbed;
  robot.Drive(30);
  undisturbed.Drive(30);
  for (int i = 0; i < 8; ++i) {
    World panel;
    panel.Add({{11.0 + 0.5 * i, -2.5}, {11.0 + 0.5 * i, 2.5}});
    robot.Drive(1, panel);
    undisturbed.Drive(1);
  }
  EXPECT_GT(robot.not_localized, 0);  // It has been doubted.
  EXPECT_LT(robot.not_localized, 6);
  robot.Drive(20);
  undisturbed.Drive(20);
  EXPECT_TRUE(robot.last.localized);
  EXPECT_LT(robot.ErrorM(), 0.5);
  EXPECT_GE(robot.mapper().keyframe_count(), undisturbed.mapper().keyframe_count());
}

// A wall that was not there before is no proof that the robot was carried: it is found nowhere else, and goes on along
// its path. It turns round before that, which makes many keyframes without way.
TEST(CarriedUnseen, ARobotBeforeWhichSomethingLargeWasPutGoesOnAlongItsPath) {
  CarriedRobot robot;
  robot.Drive(30);
  World wall;
  wall.Add({{11.0, 5.0}, {11.0, 1.0}});
  robot.Drive(6, wall);
  EXPECT_GT(robot.not_localized, 0);
  robot.TurnOnTheSpot(50, wall);
  robot.Drive(60, wall);
  EXPECT_TRUE(robot.last.localized);
  EXPECT_LT(robot.ErrorM(), 0.3);
  EXPECT_EQ(robot.wrong, 0);
}

// So does one that is only localised in the map of another robot, which does not show the wall.
TEST(CarriedUnseen, ARobotThatIsOnlyLocalisedGoesOnPastSomethingLargeThatWasPut) {
  CarriedRobot other, robot;
  other.Drive(180);
  robot.BeOnlyLocalisedIn(other);
  robot.Drive(36);
  ASSERT_EQ(robot.not_localized, 0);
  World wall;
  wall.Add({{11.0, 5.0}, {11.0, 1.0}});
  robot.Drive(6, wall);
  EXPECT_GT(robot.not_localized, 0);
  robot.Drive(60, wall);
  EXPECT_TRUE(robot.last.localized);
  EXPECT_LT(robot.ErrorM(), 0.3);
  EXPECT_EQ(robot.wrong, 0);
}

// Along a corridor of equal rooms the robot fits its map at many places, and at its path worse than at those. So it is
// not localized there, however far it drives, until it is found behind the next corner.
TEST(CarriedUnseen, ARobotAmongEqualRoomsIsNotLocalizedUntilItsPlaceShows) {
  constexpr double kStepM = 0.25, kLapM = 112.0, kWayM = 14.0, kCarriedM = 2.0;  // Half of the way from room to room.
  CarriedRobot robot(test::RingOfEqualRooms(), 8.0);
  robot.Follow(test::RingSteps(kLapM + 8.0, kStepM));
  ASSERT_LT(robot.ErrorM(), 0.5);
  const int before = robot.not_localized;
  robot.CarryAlong(kCarriedM);
  for (double way_m = 0.0; way_m < kWayM; way_m += kStepM) robot.Follow({{kStepM, 0, 0}});
  EXPECT_GT(robot.not_localized, before);
  EXPECT_EQ(robot.wrong, 0);
}

// Walls with doorways, 2.4 m apart.
World CorridorWithDoorways() {
  World corridor;
  for (const auto& [y, beyond, doorways] :
       {std::tuple(1.2, 4.0, std::vector{3.0, 9.5, 14.0, 21.5, 26.0, 34.5, 39.0, 47.5}),
        std::tuple(-1.2, -4.0, std::vector{0.0, 6.5, 12.0, 17.0, 24.0, 29.5, 37.0, 43.0})}) {
    double from = -3.0;
    for (const double x : doorways) {
      corridor.Add({{from, y}, {x, y}, {x, beyond}, {x + 1.1, beyond}, {x + 1.1, y}});
      from = x + 1.1;
    }
    corridor.Add({{from, y}, {60.0, y}});
  }
  corridor.Add({{-3.0, 1.2}, {-3.0, -1.2}});
  corridor.Add({{60.0, 1.2}, {60.0, -1.2}});
  return corridor;
}

// A door that somebody has closed changes one place; where a robot was carried, several differ.
TEST(CarriedScene, DiffersAtOnePlaceWhereADoorWasClosed) {
  const auto differs = [](const World& now, double carried_m) {
    const Laser laser{.beams = 361, .step_rad = Radians(1.0), .range_max_m = 8.0, .sigma_m = 0.01};
    std::mt19937_64 rng(3);
    const Pose2 place{12.0, 0, 0};
    const Scan a = Look(CorridorWithDoorways(), place, laser, &rng),
               b = Look(now, place * Pose2{carried_m, 0, 0}, laser, &rng);
    const std::vector<SurfacePoint> points_a = SurfacePointsOf(PointsOf(a), a, {}),
                                    points_b = SurfacePointsOf(PointsOf(b), b, {});
    return DiffersAtSeveralPlaces({a, points_a, place, 1.0}, {b, points_b, place, 1.0});
  };
  World closed = CorridorWithDoorways();
  EXPECT_FALSE(differs(closed, 0.0));
  closed.Add({{14.0, 1.2}, {15.1, 1.2}});
  EXPECT_FALSE(differs(closed, 0.0));
  closed.Add({{12.0, -1.2}, {13.1, -1.2}});
  EXPECT_TRUE(differs(closed, 0.0));
  EXPECT_TRUE(differs(CorridorWithDoorways(), 9.0));
}

// Only one that was not likely carried may go on along its path.
TEST(CarriedDoubt, IsThatOfALikelyCarriedRobotIfLittleIsExplainedOrSeveralPlacesDiffer) {
  const MapperOptions options;
  const double much = options.recovery.place.min_explained + 0.1, little = much - 0.2;
  for (const auto& [score, at_several_places, likely] :
       {std::tuple(much, false, false), std::tuple(much, true, true), std::tuple(little, false, true)}) {
    Recovery recovery(options.recovery, options.loop, options.self_check, options.front_end.refine,
                      options.front_end.surface, options.blind, true, options.lost_after_m);
    recovery.BeginOnPath({{}, {}, Eigen::Matrix3d::Identity()}, {});
    recovery.BeginDoubt({0.95, 0.01, true}, score, at_several_places);
    EXPECT_EQ(recovery.doubt()->likely, likely) << score << ' ' << at_several_places;
  }
}

TEST(CarriedScene, DiffersForLongOnlyWhereNothingMoves) {
  const SceneAgreement before{0.95, 0.01};
  EXPECT_TRUE(StaysDifferent(before, {0.8, 0.08}, 0.005));
  EXPECT_FALSE(StaysDifferent(before, {0.8, 0.08}, 0.05));      // What it saw since then moves as well.
  EXPECT_FALSE(StaysDifferent(before, {0.8, 0.015}, 0.0));      // Nothing contradicts the last keyframes any more.
  EXPECT_TRUE(StaysDifferent(before, {0.8, 0.0, false}, 0.0));  // Too little was compared.
}

}  // namespace
}  // namespace cairn::slam
