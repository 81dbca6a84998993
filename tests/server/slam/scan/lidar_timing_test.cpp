// A lidar that turns either way, from any direction, with a stamp at any of three moments, and a driver that hands its
// beams over in another order: told how it turns, the estimator sees what a lidar would have seen at once; told
// the wrong sense or the wrong moment, it does not.
#include "common/sensor/lidar_timing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "client/sim/arc.h"
#include "client/sim/laser.h"
#include "server/slam/scan/deskew.h"
#include "tests/flat_world.h"

namespace cairn::slam {
namespace {

constexpr Stamp kBegin = 5 * kNanosPerSecond;
constexpr double kPeriod_s = 0.2;
constexpr int kBeams = 360;
constexpr sim::Twist kTwist{0.5, 1.5};
const Pose2 kT_robot_laser{0.1, 0.05, 0.3};

// Of the robot in the map, after the lidar began its turn. Odometry is exact.
Pose2 PoseAfter(double seconds) {
  return Pose2{1.0, 0.5, 0.4} * sim::DriveArc(kTwist.speed_m_s * seconds, kTwist.turn_rad_s * seconds);
}

const sim::RayCaster& Hall() {
  static const sim::RayCaster walls({{{-4, -3}, {6, -3}}, {{6, -3}, {6, 5}}, {{6, 5}, {-4, 5}}, {{-4, 5}, {-4, -3}}});
  return walls;
}

// The range in one direction of the lidar, `seconds` after the lidar began its turn.
float RangeAt(double angle_rad, double seconds) {
  sim::LaserOptions one;
  one.beams = 1;
  one.error.sigma_m = one.error.sigma_share = one.dropout_share = 0.0;
  one.T_robot_laser = kT_robot_laser * Pose2{0.0, 0.0, angle_rad};
  sim::Random random(1);
  return sim::MeasureFlatScan(Hall(), {}, PoseAfter(seconds), {}, kBegin, one, random).ranges_m[0];
}

// The array runs counter-clockwise from -180 deg; `seconds_at(angle)` is the time of a beam.
template <typename SecondsAt>
Scan ArrayOf(const SecondsAt& seconds_at) {
  Scan scan;
  scan.stamp = kBegin;
  scan.angle_first_rad = -kPi;
  scan.angle_step_rad = 2.0 * kPi / kBeams;
  scan.range_max_m = 30.0;
  scan.T_robot_laser = kT_robot_laser;
  for (int i = 0; i < kBeams; ++i) {
    const double angle = scan.angle_first_rad + i * scan.angle_step_rad;
    scan.ranges_m.push_back(RangeAt(angle, seconds_at(angle)));
  }
  return scan;
}

// From a point to the nearest of the four walls.
double FromWalls(const Eigen::Vector2d& p) {
  return std::min(std::min(std::abs(p.x() + 4), std::abs(p.x() - 6)),
                  std::min(std::abs(p.y() + 3), std::abs(p.y() - 5)));
}

// The share of hits that lie within 2 cm of the walls, where the scan is put down at the odometry at its stamp.
double Share(const LidarTiming& told, Scan scan) {
  EXPECT_TRUE(PutInOrderOfTime(told, scan));
  std::vector<Odometry> wheels;
  for (double t = -0.3; t < 0.6; t += 0.01)
    wheels.push_back({0, kBegin + static_cast<Stamp>(std::llround(t * 1e9)), PoseAfter(t)});
  const auto after = std::upper_bound(wheels.begin(), wheels.end(), scan.stamp,
                                      [](Stamp stamp, const Odometry& sample) { return stamp < sample.stamp; });
  const Scan still = Deskew(scan, {&*std::prev(after), static_cast<std::size_t>(wheels.end() - std::prev(after))});
  const Pose2 T_map_laser = PoseAfter(1e-9 * static_cast<double>(scan.stamp - kBegin)) * scan.T_robot_laser;
  int hits = 0, there = 0;
  for (std::size_t i = 0; i < still.ranges_m.size(); ++i) {
    const double range = still.ranges_m[i],
                 angle = still.angle_first_rad + static_cast<double>(i) * still.angle_step_rad;
    if (std::isnan(range)) continue;
    ++hits;
    if (FromWalls(T_map_laser * (range * Eigen::Vector2d(std::cos(angle), std::sin(angle)))) < 0.02) ++there;
  }
  EXPECT_GT(hits, 320);
  return static_cast<double>(there) / hits;
}

TEST(LidarTimingInMotion, EverySenseStampAndBeginIsRecovered) {
  for (const bool clockwise : {false, true}) {
    for (const double from_deg : {-180.0, 0.0, 90.0}) {
      const double from = Radians(from_deg);
      Scan logged = ArrayOf([&](double angle) {
        const double turned = std::remainder((clockwise ? from - angle : angle - from) - kPi + 1e-9, 2.0 * kPi) + kPi;
        return turned / (2.0 * kPi) * kPeriod_s;
      });
      for (const StampAt stamp_at : {StampAt::kFirst, StampAt::kMiddle, StampAt::kLast}) {
        const double last_s = kPeriod_s * (kBeams - 1) / kBeams;
        logged.stamp = kBegin + static_cast<Stamp>(std::llround(0.5 * static_cast<int>(stamp_at) * last_s * 1e9));
        const std::string what = (clockwise ? "clockwise from " : "counter-clockwise from ") +
                                 std::to_string(from_deg) + ", stamp " + std::to_string(static_cast<int>(stamp_at));
        EXPECT_GT(Share({kPeriod_s, stamp_at, clockwise, from}, logged), 0.97) << what;
        // A lidar that is taken for one at once, that turns the other way, begins elsewhere, or has another stamp.
        EXPECT_LT(Share({}, logged), 0.5) << what;
        EXPECT_LT(Share({kPeriod_s, stamp_at, !clockwise, from}, logged), 0.5) << what;
        EXPECT_LT(Share({kPeriod_s, stamp_at, clockwise, from + kPi}, logged), 0.7) << what;
        const StampAt other = stamp_at == StampAt::kMiddle ? StampAt::kFirst : StampAt::kMiddle;
        EXPECT_LT(Share({kPeriod_s, other, clockwise, from}, logged), 0.5) << what;
      }
    }
  }
}

}  // namespace
}  // namespace cairn::slam
