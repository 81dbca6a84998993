// The laser in space: exact ranges against geometry, the three kinds of error, the models, the tilting mount.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "client/sim/fleet.h"
#include "client/sim/laser_models.h"
#include "client/sim/shipped_worlds.h"
#include "client/sim/tilt_mount.h"
#include "tests/flat_world.h"

namespace cairn::sim {
namespace {

LaserOptions Perfect() {
  LaserOptions options;
  options.error.sigma_m = options.error.sigma_share = options.dropout_share = 0.0;
  options.range_max_m = 100.0;
  return options;
}

// A room of x -4..6, y -3..5, z 0..2.5.
std::vector<Rectangle> RoomRectangles() {
  std::vector<Rectangle> room = {Slab({-4, -3}, {6, 5}, 0.0), Slab({-4, -3}, {6, 5}, 2.5)};
  room.push_back({{-4, -3, 0}, {10, 0, 0}, {0, 0, 2.5}});
  room.push_back({{-4, 5, 0}, {10, 0, 0}, {0, 0, 2.5}});
  room.push_back({{-4, -3, 0}, {0, 8, 0}, {0, 0, 2.5}});
  room.push_back({{6, -3, 0}, {0, 8, 0}, {0, 0, 2.5}});
  return room;
}

// Distance in a convex box: the nearest of the six planes ahead. Needs no rectangle.
double RangeInBox(const Eigen::Vector3d& p, const Eigen::Vector3d& d) {
  const Eigen::Vector3d low(-4, -3, 0), high(6, 5, 2.5);
  double range = kNothingHit;
  for (int axis = 0; axis < 3; ++axis) {
    if (d(axis) > 0) range = std::min(range, (high(axis) - p(axis)) / d(axis));
    if (d(axis) < 0) range = std::min(range, (low(axis) - p(axis)) / d(axis));
  }
  return range;
}

TEST(LaserInSpace, RangesAreExactAgainstGeometry) {
  const SolidScene scene(RoomRectangles());
  Random random(1);
  for (const double tilt_deg : {-85.0, -40.0, -10.0, 0.0, 5.0, 30.0, 70.0}) {
    for (const double heading : {0.0, 0.7, 2.9, -2.0}) {
      LaserOptions options = Perfect();
      options.beams = 181;
      options.field_of_view_rad = kPi;
      options.height_m = 0.6;
      options.T_robot_laser = {0.3, -0.2, 0.25};
      const Pose2 T_map_robot{1.0, 0.5, heading};
      const double tilt = Radians(tilt_deg);
      const Scan scan = MeasureScan(scene, {}, T_map_robot, {}, 5, tilt, options, random);
      EXPECT_EQ(scan.tilt_rad, tilt);
      const Pose2 T_map_laser = T_map_robot * options.T_robot_laser;
      for (int i = 0; i < options.beams; ++i) {
        // The beam turned about y by hand: x' = x cos t, z' = -x sin t.
        const double bearing = scan.angle_first_rad + i * scan.angle_step_rad;
        const double x = std::cos(bearing) * std::cos(tilt), y = std::sin(bearing);
        const double c = std::cos(T_map_laser.theta), s = std::sin(T_map_laser.theta);
        const Eigen::Vector3d d(c * x - s * y, s * x + c * y, -std::cos(bearing) * std::sin(tilt));
        EXPECT_NEAR(scan.ranges_m[static_cast<std::size_t>(i)], RangeInBox({T_map_laser.x, T_map_laser.y, 0.6}, d),
                    2e-5)
            << tilt_deg << " " << heading << " beam " << i;
      }
      EXPECT_TRUE(ValidateScan(scan));
    }
  }
}

TEST(LaserInSpace, ALevelScanIsTheFlatWorlds) {
  const SolidScene scene(RoomRectangles());
  const RayCaster walls({{{-4, -3}, {6, -3}}, {{6, -3}, {6, 5}}, {{6, 5}, {-4, 5}}, {{-4, 5}, {-4, -3}}});
  Random random(1);
  const Scan flat = MeasureFlatScan(walls, {}, {1, 1, 0.4}, {}, 5, Perfect(), random);
  const Scan solid = MeasureScan(scene, {}, {1, 1, 0.4}, {}, 5, 0.0, Perfect(), random);
  for (std::size_t i = 0; i < flat.ranges_m.size(); ++i) EXPECT_NEAR(flat.ranges_m[i], solid.ranges_m[i], 1e-5);
}

struct Moments {
  double mean = 0.0;
  double sigma = 0.0;
  double largest = 0.0;
};

Moments ErrorsOf(const RangeError& error, double range) {
  Random random(11);
  const int n = 40000;
  Moments m;
  for (int i = 0; i < n; ++i) {
    const double e = DrawError(error, range, random);
    m.mean += e / n;
    m.sigma += e * e / n;
    m.largest = std::max(m.largest, std::abs(e));
  }
  m.sigma = std::sqrt(m.sigma);
  return m;
}

TEST(RangeError, SigmaIsTheStandardDeviation) {
  const RangeError error{RangeErrorKind::kSigma, 0.005, 0.002};
  for (const double range : {0.5, 4.0, 20.0}) {
    const Moments m = ErrorsOf(error, range);
    const double sigma = 0.005 + 0.002 * range;
    EXPECT_NEAR(m.mean, 0.0, 4 * sigma / 200);
    EXPECT_NEAR(m.sigma, sigma, 0.02 * sigma);
    EXPECT_GT(m.largest, 3 * sigma);
  }
}

// A uniform error within +-e has standard deviation e / sqrt(3), and nothing beyond e.
void ExpectBound(const RangeError& error, double range, double bound) {
  const Moments m = ErrorsOf(error, range);
  EXPECT_NEAR(m.mean, 0.0, 4 * bound / 200);
  EXPECT_NEAR(m.sigma, bound / std::sqrt(3.0), 0.02 * bound);
  EXPECT_LE(m.largest, bound);
  EXPECT_GT(m.largest, 0.99 * bound);
}

TEST(RangeError, PercentIsABoundFixedOrOfTheRange) {
  ExpectBound({RangeErrorKind::kPercent, 0, 0, 0.010, 0.0}, 0.5, 0.010);
  ExpectBound({RangeErrorKind::kPercent, 0, 0, 0.010, 0.0}, 50.0, 0.010);
  ExpectBound({RangeErrorKind::kPercent, 0, 0, 0.0, 0.02}, 5.0, 0.1);
}

// Hokuyo URG-04LX: +-10 mm up to 1 m, 1 % beyond.
TEST(RangeError, StepIsFixedAndThenAShare) {
  const RangeError error{RangeErrorKind::kStep, 0, 0, 0.010, 0.01, 1.0};
  ExpectBound(error, 0.3, 0.010);
  ExpectBound(error, 1.0, 0.010);
  ExpectBound(error, 3.0, 0.030);
}

TEST(RangeError, ReachesTheScans) {
  const SolidScene scene(RoomRectangles());
  Random random(2);
  LaserOptions options = Perfect();
  options.beams = 1;
  options.T_robot_laser = {};
  options.error = {RangeErrorKind::kStep, 0, 0, 0.01, 0.02, 1.0};
  double largest = 0.0, squares = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const double e = MeasureScan(scene, {}, {}, {}, 5, 0.0, options, random).ranges_m[0] - 6.0;
    largest = std::max(largest, std::abs(e));
    squares += e * e / 20000;
  }
  EXPECT_LE(largest, 0.12 + 1e-6);
  EXPECT_NEAR(std::sqrt(squares), 0.12 / std::sqrt(3.0), 0.002);
}

TEST(LaserModels, AreTheScannersOfTheThesis) {
  for (const std::string& name : LaserModelNames()) {
    const auto model = WithModel({}, name);
    ASSERT_TRUE(model);
    EXPECT_TRUE(Validate(model->laser)) << name;
  }
  const LaserOptions sick = WithModel({}, "lms200")->laser, hokuyo = WithModel({}, "urg-04lx")->laser;
  EXPECT_EQ(ErrorScale(sick.error, 20.0), 0.005);
  EXPECT_EQ(sick.sweep_s, 0.0);
  EXPECT_EQ(hokuyo.error.kind, RangeErrorKind::kStep);
  EXPECT_NEAR(hokuyo.field_of_view_rad / (hokuyo.beams - 1), 2 * kPi / 1024, 1e-12);
  EXPECT_FALSE(WithModel({}, "lms9000"));
}

TEST(LaserModels, LidarsOfTodayTurnAndRound) {
  for (const std::string name : {"rplidar-a1", "lds-01", "ld19", "xv11", "urg-04lx", "utm-30lx", "tim561"}) {
    LaserOptions mine;
    mine.error.bias_m = 0.03;
    const auto model = WithModel(mine, name);
    ASSERT_TRUE(model) << name;
    EXPECT_GT(model->scan_hz, 0.0) << name;
    EXPECT_EQ(model->laser.error.bias_m, 0.03) << name;
    // A beam every step of the turn: no beam of the next turn comes before the last one of this turn.
    const double turn_s = model->laser.sweep_s / (model->laser.beams - 1) * 2 * kPi /
                          (model->laser.field_of_view_rad /
                           (model->laser.field_of_view_rad > 6.28 ? model->laser.beams : model->laser.beams - 1));
    EXPECT_NEAR(turn_s, 1.0 / model->scan_hz, 1e-9) << name;
  }
  EXPECT_TRUE(WithModel({}, "rplidar-a1")->laser.clockwise);
  EXPECT_FALSE(WithModel({}, "xv11")->laser.clockwise);
  const RangeError utm = WithModel({}, "utm-30lx")->laser.error;
  EXPECT_EQ(ErrorScale(utm, 10.0), 0.010);
  EXPECT_EQ(ErrorScale(utm, 10.1), 0.030);
}

TEST(RangeError, BiasComesBeforeRounding) {
  RangeError error{RangeErrorKind::kSigma, 0.0, 0.0, 0.0, 0.0, 1.0};
  error.bias_m = 0.02;
  error.bias_share = 0.01;
  error.quantum_m = 0.05;
  Random random(1);
  EXPECT_DOUBLE_EQ(Measured(error, 4.0, random), 4.05);  // 4.06.
  EXPECT_DOUBLE_EQ(Measured(error, 4.01, random), 4.05);
  error.bias_m = -5.0;
  EXPECT_EQ(Measured(error, 4.0, random), 0.0);
}

TEST(SimLaser, AClockwiseLidarSeesTheSameBeamsInTheOtherOrder) {
  const SolidScene scene(RoomRectangles());
  Random random(2);
  LaserOptions options = Perfect();
  options.beams = 91;
  options.field_of_view_rad = kPi / 2;
  const Scan left = MeasureScan(scene, {}, {}, {}, 5, 0.0, options, random);
  options.clockwise = true;
  Scan right = MeasureScan(scene, {}, {}, {}, 5, 0.0, options, random);
  EXPECT_LT(right.angle_step_rad, 0.0);
  EXPECT_NEAR(right.angle_first_rad, kPi / 4, 1e-12);
  std::reverse(right.ranges_m.begin(), right.ranges_m.end());
  for (std::size_t i = 0; i < left.ranges_m.size(); ++i) EXPECT_NEAR(left.ranges_m[i], right.ranges_m[i], 1e-6);
}

TEST(TiltMount, NodsBetweenLevelScans) {
  TiltOptions options{.scans = 5, .first_rad = -0.4, .last_rad = 0.4, .level_scans = 20, .halt = true};
  ASSERT_TRUE(Validate(options, 6));
  EXPECT_EQ(TiltOf(0, options), 0.0);
  EXPECT_EQ(TiltOf(19, options), 0.0);
  EXPECT_NEAR(TiltOf(20, options), -0.4, 1e-12);
  EXPECT_NEAR(TiltOf(22, options), 0.0, 1e-12);
  EXPECT_NEAR(TiltOf(24, options), 0.4, 1e-12);
  EXPECT_EQ(TiltOf(25, options), 0.0);
  EXPECT_FALSE(HaltsAt(13, options, 6));
  EXPECT_TRUE(HaltsAt(14, options, 6));
  EXPECT_TRUE(HaltsAt(24, options, 6));
  EXPECT_FALSE(HaltsAt(25, options, 6));
  options.halt = false;
  EXPECT_FALSE(HaltsAt(24, options, 6));
  options = {};
  EXPECT_EQ(TiltOf(1000, options), 0.0) << "a fixed mount";
  EXPECT_FALSE(Validate({.scans = 5, .first_rad = -2.0, .last_rad = 0.4, .level_scans = 20, .halt = true}, 6));
  EXPECT_FALSE(Validate({.scans = 5, .first_rad = 0, .last_rad = 0.4, .level_scans = 10, .halt = true}, 6));
}

TEST(FleetInSpace, RobotsStandWhileTheyNodAndStayClear) {
  auto world = OpenWorld3("hall3d");
  ASSERT_TRUE(world) << world.error().message;
  const RectangleTree tree(world->rectangles);
  FleetOptions options;
  options.robots = 1;
  options.scan_hz = 5;
  options.laser.beams = 3;
  options.tilt = {.scans = 10, .first_rad = -1.0, .last_rad = 0.6, .level_scans = 30, .halt = true};
  auto fleet = Fleet::Create(SurroundingsOf(*world), options);
  ASSERT_TRUE(fleet) << fleet.error().message;
  int tilted = 0, moved = 0;
  Pose2 before;
  bool before_tilted = false;
  for (int i = 0; i < 40000; ++i) {
    const FleetRecord record = fleet->Next();
    const auto* scan = std::get_if<Scan>(&record.record);
    if (scan == nullptr) continue;
    const Pose2 now = fleet->truth(0).back().T_map_robot;
    if (scan->tilt_rad != 0.0) {
      ++tilted;
      if (before_tilted) {
        EXPECT_LT((now.translation() - before.translation()).norm(), 1e-9);
      }
    } else {
      moved += (now.translation() - before.translation()).norm() > 0.05;
    }
    before = now;
    before_tilted = scan->tilt_rad != 0.0;
    // Nothing as high as the robot comes near it.
    for (const double z : {0.1, 0.4, 0.7}) {
      for (int k = 0; k < 8; ++k) {
        const double angle = k * kPi / 4;
        ASSERT_GT(tree.Cast({now.x, now.y, z}, {std::cos(angle), std::sin(angle), 0}, 10.0), 0.25)
            << now.x << ", " << now.y;
      }
    }
  }
  EXPECT_GT(tilted, 500);
  EXPECT_GT(moved, 500);
}

}  // namespace
}  // namespace cairn::sim
