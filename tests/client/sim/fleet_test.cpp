#include "client/sim/fleet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "client/sim/shipped_worlds.h"
#include "client/sim/world_file.h"
#include "tests/flat_world.h"

namespace cairn::sim {
namespace {

Fleet Make(const std::string& world, const FleetOptions& options) {
  auto opened = OpenWorld(world);
  EXPECT_TRUE(opened) << opened.error().message;
  auto fleet = Fleet::Create(*opened, options);
  EXPECT_TRUE(fleet) << fleet.error().message;
  return std::move(*fleet);
}

Stamp StampOf(const LogRecord& record) {
  return std::visit([](const auto& value) { return value.stamp; }, record);
}

std::vector<FleetRecord> Take(Fleet& fleet, double seconds) {
  std::vector<FleetRecord> records;
  const FleetRecord first = fleet.Next();
  const Stamp end = StampOf(first.record) + StampFromSeconds(seconds);
  for (FleetRecord record = first; StampOf(record.record) <= end; record = fleet.Next()) records.push_back(record);
  return records;
}

bool Same(const FleetRecord& a, const FleetRecord& b) {
  if (a.robot != b.robot || a.record.index() != b.record.index() || StampOf(a.record) != StampOf(b.record))
    return false;
  if (const auto* odometry = std::get_if<Odometry>(&a.record)) {
    return odometry->T_odom_robot == std::get<Odometry>(b.record).T_odom_robot;
  }
  return std::get<Scan>(a.record).ranges_m == std::get<Scan>(b.record).ranges_m;
}

TEST(Fleet, SameSeedGivesTheSameRecords) {
  FleetOptions options;
  options.robots = 4;
  Fleet one = Make("building", options), two = Make("building", options);
  options.seed = 2;
  Fleet other = Make("building", options);
  bool differs = false;
  for (int i = 0; i < 2000; ++i) {
    const FleetRecord record = one.Next();
    EXPECT_TRUE(Same(record, two.Next())) << i;
    differs |= !Same(record, other.Next());
  }
  EXPECT_TRUE(differs);
}

// The longest range of each scan, by the time since the beginning, of a robot that drives from (2, 2) towards (4, 2) in
// a hall of 20 x 4 m.
std::map<double, float> FarthestSeen(const std::string& doors, double seconds) {
  const auto place = ParseSurroundings(
      "cairn-world: 1\nlines: [{points: [[0, 0], [20, 0], [20, 4], [0, 4]], closed: true}]\ndoors: " + doors +
          "\nroutes: [{name: r, points: [[2, 2], [4, 2]]}]\n",
      "test");
  EXPECT_TRUE(place) << place.error().message;
  FleetOptions options;
  options.robots = 1;
  options.laser.range_max_m = 30.0;
  auto fleet = Fleet::Create(*place, options);
  EXPECT_TRUE(fleet) << fleet.error().message;
  std::map<double, float> farthest;
  for (const FleetRecord& record : Take(*fleet, seconds)) {
    if (const auto* scan = std::get_if<Scan>(&record.record))
      farthest[SecondsFromStamp(scan->stamp - options.first_stamp)] =
          *std::max_element(scan->ranges_m.begin(), scan->ranges_m.end());
  }
  return farthest;
}

TEST(Fleet, AClosedDoorHidesWhatIsBehindItAndAnOpenOneDoesNot) {
  int closed = 0, open = 0;
  for (const auto& [seconds, range_m] : FarthestSeen("[{from: [10, 0], to: [10, 4], closed: 0.5, open: 0.5}]", 1.9)) {
    const double into_turn_s = std::fmod(seconds, 1.0);
    if (std::abs(into_turn_s - 0.5) < 0.01 || into_turn_s > 0.99) continue;
    EXPECT_EQ(range_m < 9.0F, into_turn_s < 0.5) << seconds;
    ++(into_turn_s < 0.5 ? closed : open);
  }
  EXPECT_GT(closed, 5);
  EXPECT_GT(open, 5);
}

TEST(Fleet, ADoorOpensForARobotThatIsNear) {
  const auto farthest = FarthestSeen("[{from: [3, 0], to: [3, 4], closed: 1000, open: 1}]", 4.0);
  EXPECT_LT(farthest.begin()->second, 5.0F);
  EXPECT_TRUE(std::any_of(farthest.begin(), farthest.end(), [](const auto& one) { return one.second > 10.0F; }));
}

TEST(Fleet, RecordsComeInTheOrderOfTheirStampsAtTheirRates) {
  FleetOptions options;
  options.robots = 3;
  options.scan_hz = 7;
  options.odometry_hz = 30;
  Fleet fleet = Make("building", options);
  const auto records = Take(fleet, 10.0);
  std::map<int, int> scans, odometries;
  Stamp last = options.first_stamp;
  for (const FleetRecord& record : records) {
    EXPECT_GE(StampOf(record.record), last);
    last = StampOf(record.record);
    if (const auto* scan = std::get_if<Scan>(&record.record)) {
      EXPECT_EQ(scan->sequence, static_cast<std::uint64_t>(++scans[record.robot]));
      EXPECT_GT(odometries[record.robot], 0) << "a scan before the first odometry";
    } else {
      ++odometries[record.robot];
    }
  }
  for (int robot = 0; robot < 3; ++robot) {
    EXPECT_NEAR(scans[robot], 70, 1);
    EXPECT_NEAR(odometries[robot], 300, 1);
  }
}

TEST(Fleet, RobotsMaySendNoOdometryAndDriveTheSame) {
  FleetOptions options;
  options.robots = 1;
  Fleet with = Make("building", options);
  options.odometry_hz = 0.0;
  Fleet without = Make("building", options);
  auto records = Take(with, 5.0);
  std::erase_if(records, [](const FleetRecord& one) { return std::holds_alternative<Odometry>(one.record); });
  const auto silent = Take(without, 5.0);
  ASSERT_EQ(silent.size(), records.size());
  for (std::size_t i = 0; i < silent.size(); ++i) {
    ASSERT_TRUE(std::holds_alternative<Scan>(silent[i].record));
    EXPECT_EQ(std::get<Scan>(silent[i].record).ranges_m, std::get<Scan>(records[i].record).ranges_m);
  }
}

TEST(Fleet, TruthHasOnePosePerScanAtItsStamp) {
  FleetOptions options;
  options.robots = 2;
  Fleet fleet = Make("room", options);
  std::vector<Stamp> stamps;
  for (const FleetRecord& record : Take(fleet, 5.0)) {
    if (record.robot == 1 && std::holds_alternative<Scan>(record.record)) stamps.push_back(StampOf(record.record));
  }
  ASSERT_GE(fleet.truth(1).size(), stamps.size());
  for (std::size_t i = 0; i < stamps.size(); ++i) EXPECT_EQ(fleet.truth(1)[i].stamp, stamps[i]);
}

TEST(Fleet, OdometryOfPerfectWheelsIsTheTruthSeenFromTheStart) {
  FleetOptions options;
  options.robots = 1;
  options.scan_hz = options.odometry_hz = 10;
  options.wheels.slip_m_per_sqrt_m = 0;
  options.wheel_spread = {0, 0};
  Fleet fleet = Make("building", options);
  Pose2 T_odom_robot;
  for (const FleetRecord& record : Take(fleet, 30.0)) {
    if (const auto* odometry = std::get_if<Odometry>(&record.record)) T_odom_robot = odometry->T_odom_robot;
    if (std::holds_alternative<Scan>(record.record)) {
      const Pose2 believed = fleet.T_map_robot_start(0) * T_odom_robot;
      EXPECT_NEAR((believed.translation() -
                   fleet.truth(0)[std::get<Scan>(record.record).sequence - 1].T_map_robot.translation())
                      .norm(),
                  0, 1e-6);
    }
  }
}

// Perfect wheels say every 2 ms where the robot is, also where it brakes or begins to turn within a scan.
TEST(Fleet, EachBeamOfASweepIsMeasuredFromWhereTheRobotIsThen) {
  FleetOptions options;
  options.robots = 1;
  options.scan_hz = 5;
  options.odometry_hz = 500;
  options.wheels.slip_m_per_sqrt_m = 0;
  options.wheel_spread = {0, 0};
  options.laser.beams = 90;
  options.laser.sweep_s = 0.19;
  options.laser.error.sigma_m = options.laser.error.sigma_share = options.laser.dropout_share = 0;
  Fleet fleet = Make("room", options);
  std::vector<Odometry> odometry;
  std::vector<Scan> scans;
  for (const FleetRecord& record : Take(fleet, 30.0)) {
    if (const auto* sample = std::get_if<Odometry>(&record.record)) odometry.push_back(*sample);
    if (const auto* scan = std::get_if<Scan>(&record.record)) scans.push_back(*scan);
  }
  scans.pop_back();  // Odometry ends within it.
  const Surroundings room = SurroundingsOf(*OpenWorld("room"));
  int beams = 0, wrong = 0;
  for (const Scan& scan : scans) {
    for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
      const double since_s = SecondsFromStamp(scan.stamp - odometry.front().stamp) + i * scan.beam_period_s;
      const auto before = static_cast<std::size_t>(since_s * 500.0 + 1e-6);
      ASSERT_LT(before + 1, odometry.size());
      const Pose2 T_odom_robot = Interpolate(odometry[before].T_odom_robot, odometry[before + 1].T_odom_robot,
                                             since_s * 500.0 - static_cast<double>(before));
      const Pose2 T_map_laser = fleet.T_map_robot_start(0) * T_odom_robot * scan.T_robot_laser;
      const double angle = T_map_laser.theta + scan.angle_first_rad + static_cast<double>(i) * scan.angle_step_rad;
      const Eigen::Vector3d origin(T_map_laser.x, T_map_laser.y, 0.4), direction(std::cos(angle), std::sin(angle), 0.0);
      const double range_m =
          std::min(room.scene->Cast(origin, direction, 30.0), CastAtPosts(room.posts, origin, direction));
      ++beams;
      wrong += std::abs(range_m - scan.ranges_m[i]) > 0.002 ? 1 : 0;  // Beams along an edge may go to either side.
    }
  }
  EXPECT_GT(beams, 13'000);
  EXPECT_LT(wrong, beams / 1000);
}

TEST(Fleet, RealWheelsDriftAwayFromTheTruth) {
  FleetOptions options;
  options.robots = 1;
  Fleet fleet = Make("building", options);
  Pose2 T_odom_robot;
  for (const FleetRecord& record : Take(fleet, 120.0)) {
    if (const auto* odometry = std::get_if<Odometry>(&record.record)) T_odom_robot = odometry->T_odom_robot;
  }
  const Pose2 believed = fleet.T_map_robot_start(0) * T_odom_robot;
  const double error = (believed.translation() - fleet.truth(0).back().T_map_robot.translation()).norm();
  EXPECT_GT(error, 0.2);
  EXPECT_LT(error, 30.0);
}

TEST(Fleet, MoreRobotsThanRoutesStartApart) {
  FleetOptions options;
  options.robots = 16;
  const Fleet fleet = Make("building", options);
  for (int a = 0; a < 16; ++a) {
    for (int b = a + 1; b < 16; ++b) {
      const Eigen::Vector2d apart = fleet.T_map_robot_start(a).translation() - fleet.T_map_robot_start(b).translation();
      EXPECT_GT(apart.norm(), 0.5) << a << " " << b;
    }
    EXPECT_EQ(fleet.name(a), "robot" + std::to_string(a + 1));
  }
}

TEST(Fleet, RobotsKeepTheirLimits) {
  FleetOptions options;
  options.robots = 3;
  options.odometry_hz = 100;
  options.scan_hz = 100;
  options.laser.beams = 1;
  Fleet fleet = Make("building", options);
  Take(fleet, 60.0);
  for (int robot = 0; robot < 3; ++robot) {
    const Trajectory& truth = fleet.truth(robot);
    double way = 0;
    for (std::size_t i = 1; i < truth.size(); ++i) {
      const double seconds = SecondsFromStamp(truth[i].stamp - truth[i - 1].stamp);
      const Pose2 step = Between(truth[i - 1].T_map_robot, truth[i].T_map_robot);
      EXPECT_LE(step.translation().norm(), options.drive.speed_m_s * seconds + 1e-9);
      EXPECT_LE(std::abs(step.theta), options.drive.turn_rad_s * seconds + 1e-9);
      way += step.translation().norm();
    }
    EXPECT_GT(way, 20.0) << "it gets somewhere";
  }
}

TEST(Fleet, RobotsSeeEachOther) {
  FleetOptions options;
  options.robots = 2;
  options.laser.range_max_m = 60;
  options.laser.error.sigma_m = options.laser.error.sigma_share = options.laser.dropout_share = 0;
  options.wheels.slip_m_per_sqrt_m = 0;  // No random draws: both fleets drive alike.
  Fleet seeing = Make("corridor", options);
  options.see_each_other = false;
  Fleet blind = Make("corridor", options);
  int nearer = 0;
  for (int i = 0; i < 2000; ++i) {
    const FleetRecord a = seeing.Next(), b = blind.Next();
    const auto* scan = std::get_if<Scan>(&a.record);
    if (!scan) continue;
    for (std::size_t k = 0; k < scan->ranges_m.size(); ++k) {
      EXPECT_LE(scan->ranges_m[k], std::get<Scan>(b.record).ranges_m[k]);
      nearer += scan->ranges_m[k] < std::get<Scan>(b.record).ranges_m[k];
    }
  }
  EXPECT_GT(nearer, 100);
}

class ShippedWorld : public ::testing::TestWithParam<std::string> {};

TEST_P(ShippedWorld, RobotsDriveItsRoutesClearOfEverything) {
  auto world = OpenWorld(GetParam());
  ASSERT_TRUE(world) << world.error().message;
  EXPECT_EQ(world->name, GetParam());
  FleetOptions options;
  options.robots = static_cast<int>(world->routes.size());
  options.laser.beams = 1;
  options.scan_hz = 5;
  Fleet fleet = Make(GetParam(), options);
  Take(fleet, 400.0);
  for (int robot = 0; robot < fleet.robots(); ++robot) {
    for (const StampedPose& pose : fleet.truth(robot)) {
      double clearance = DistanceToWalls(world->segments, pose.T_map_robot.translation());
      for (const Disc& disc : world->discs) {
        clearance = std::min(clearance, (disc.center_map - pose.T_map_robot.translation()).norm() - disc.radius_m);
      }
      ASSERT_GT(clearance, options.robot_radius_m + 0.1)
          << "robot " << robot << " at " << pose.T_map_robot.x << ", " << pose.T_map_robot.y;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, ShippedWorld, ::testing::Values("building", "office", "storey", "corridor", "room"),
                         [](const auto& param) { return param.param; });

TEST(Fleet, RefusesWhatCannotBe) {
  const auto world = OpenWorld("room");
  ASSERT_TRUE(world);
  FleetOptions options;
  options.robots = 0;
  EXPECT_FALSE(Fleet::Create(*world, options));
  options = {};
  options.scan_hz = 0;
  EXPECT_FALSE(Fleet::Create(*world, options));
  World empty = *world;
  empty.routes.clear();
  const auto fleet = Fleet::Create(empty, {});
  ASSERT_FALSE(fleet);
  EXPECT_THAT(fleet.error().message, ::testing::HasSubstr("no route"));
}

}  // namespace
}  // namespace cairn::sim
