// Scans of a lidar whose beams follow one another while the robot drives, made into what it would have seen at once.
#include "server/slam/scan/deskew.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "client/sim/arc.h"
#include "client/sim/laser.h"
#include "server/slam/scan/odometry_pairing.h"
#include "tests/flat_world.h"

namespace cairn::slam {
namespace {

constexpr Stamp kStart = 5 * kNanosPerSecond;
constexpr double kTurn_s = 0.2;  // Of the lidar.
const Pose2 kT_map_robot{1.0, 0.5, 0.4};

const sim::RayCaster& Room() {
  static const sim::RayCaster walls({{{-4, -3}, {6, -3}}, {{6, -3}, {6, 5}}, {{6, 5}, {-4, 5}}, {{-4, 5}, {-4, -3}}});
  return walls;
}

struct Case {
  double field_of_view_deg = 360.0;
  sim::Twist twist{0.5, 1.2};
  std::vector<sim::Disc> pillars;
};

Scan Measure(const Case& given, double sweep_s) {
  sim::LaserOptions options;
  options.beams = 360;
  options.field_of_view_rad = Radians(given.field_of_view_deg);
  options.error.sigma_m = options.error.sigma_share = options.dropout_share = 0.0;
  options.sweep_s = sweep_s;
  options.T_robot_laser = {0.1, 0.05, 0.3};
  sim::Random random(1);
  return sim::MeasureFlatScan(Room(), given.pillars, kT_map_robot, given.twist, kStart, options, random);
}

// Samples each 40 ms from 30 ms before the scan on; the frame is not that of the map.
std::vector<Odometry> Wheels(const sim::Twist& twist) {
  std::vector<Odometry> samples;
  const Pose2 T_odom_start{-3.0, 2.0, 1.9};
  for (double t = -0.03; t < kTurn_s + 0.04; t += 0.04) {
    const Pose2 moved = sim::DriveArc(twist.speed_m_s * t, twist.turn_rad_s * t);
    samples.push_back({0, kStart + static_cast<Stamp>(std::llround(t * 1e9)), T_odom_start * moved});
  }
  return samples;
}

// The share of beams whose ranges differ by less than 2 cm, of those that are valid in both.
double ShareThatAgrees(const Scan& a, const Scan& b) {
  int valid = 0, same = 0;
  for (std::size_t i = 0; i < a.ranges_m.size(); ++i) {
    if (std::isnan(a.ranges_m[i]) || std::isnan(b.ranges_m[i])) continue;
    ++valid;
    if (std::abs(a.ranges_m[i] - b.ranges_m[i]) < 0.02F) ++same;
  }
  EXPECT_GT(valid, 300);
  return static_cast<double>(same) / valid;
}

TEST(Deskew, GivesTheScanThatAllBeamsAtOnceWouldHaveGiven) {
  for (const double field_of_view : {180.0, 270.0, 360.0}) {
    for (const sim::Twist twist : {sim::Twist{0.5, 1.2}, sim::Twist{0.5, -1.2}, sim::Twist{1.5, 0.0}}) {
      const Case given{.field_of_view_deg = field_of_view, .twist = twist, .pillars = {}};
      const Scan at_once = Measure(given, 0.0), rolling = Measure(given, kTurn_s);
      EXPECT_LT(ShareThatAgrees(rolling, at_once), 0.6);
      const Scan deskewed = Deskew(rolling, Wheels(twist));
      EXPECT_GT(ShareThatAgrees(deskewed, at_once), 0.98) << field_of_view << " deg, " << twist.turn_rad_s << " rad/s";
      EXPECT_EQ(deskewed.beam_period_s, 0.0);
      EXPECT_EQ(deskewed.stamp, rolling.stamp);
    }
  }
}

// The ends of one pillar and of the wall behind it are not joined.
TEST(Deskew, KeepsNearThingsApartFromWhatIsBehindThem) {
  const Case given{.pillars = {{{2.5, 1.5}, 0.15}, {{0.0, 2.0}, 0.1}, {{-1.0, -1.0}, 0.2}}};
  const Scan at_once = Measure(given, 0.0);
  EXPECT_GT(ShareThatAgrees(Deskew(Measure(given, kTurn_s), Wheels(given.twist)), at_once), 0.98);
}

TEST(Deskew, WhatHitNothingStaysFreeAndWhatIsInvalidStaysInvalid) {
  const Case given{.twist = {0.0, 1.0}, .pillars = {}};
  Scan rolling = Measure(given, kTurn_s);
  for (std::size_t i = 100; i < 200; ++i) rolling.ranges_m[i] = std::numeric_limits<float>::infinity();
  for (std::size_t i = 250; i < 300; ++i) rolling.ranges_m[i] = 0.0F;
  const Scan deskewed = Deskew(rolling, Wheels(given.twist));
  // At 1 rad/s the beams from 100 to 200 are seen 3 to 6 deg farther on.
  for (std::size_t i = 108; i < 202; ++i) EXPECT_TRUE(std::isinf(deskewed.ranges_m[i])) << i;
  for (std::size_t i = 261; i < 307; ++i) EXPECT_TRUE(std::isnan(deskewed.ranges_m[i])) << i;
}

TEST(Deskew, OfARobotThatStandsChangesNoRange) {
  const Case given{.twist = {}, .pillars = {}};
  const Scan rolling = Measure(given, kTurn_s);
  EXPECT_EQ(Deskew(rolling, Wheels({})).ranges_m, rolling.ranges_m);
}

// Whatever a peer may send takes little time and gives nothing that lies between opposite directions.
TEST(Deskew, OfATinyStepOrAFastTurnEndsAndInventsNothing) {
  const Case given{.field_of_view_deg = 180.0, .pillars = {}};
  Scan tiny = Measure(given, kTurn_s);
  tiny.angle_step_rad = 1e-300;
  EXPECT_EQ(Deskew(tiny, Wheels(given.twist)).ranges_m.size(), tiny.ranges_m.size());
  for (float& range : tiny.ranges_m) range = std::numeric_limits<float>::infinity();
  EXPECT_EQ(Deskew(tiny, Wheels(given.twist)).ranges_m.size(), tiny.ranges_m.size());

  // At 17 rad/s the robot turns by half a turn and more within the scan, and the directions come round again.
  const Case fast{.field_of_view_deg = 90.0, .twist = {0.0, 17.0}, .pillars = {}};
  const Scan at_once = Measure(fast, 0.0), deskewed = Deskew(Measure(fast, kTurn_s), Wheels(fast.twist));
  for (std::size_t i = 0; i < at_once.ranges_m.size(); ++i) {
    if (std::isnan(deskewed.ranges_m[i])) continue;
    EXPECT_NEAR(deskewed.ranges_m[i], at_once.ranges_m[i], 0.2F) << i;
  }
}

// The only hits turn out of the field of view: such a scan stays as it came, because an estimator needs a usable beam.
TEST(OdometryPairing, LeavesAScanOfWhichNothingWouldBeLeft) {
  std::vector<PairedScan> pairs;
  OdometryPairing pairing({}, {[&](PairedScan&& pair) { pairs.push_back(std::move(pair)); }, {}});
  const Case given{.field_of_view_deg = 90.0, .twist = {0.0, 2.0}, .pillars = {}};
  Scan scan = Measure(given, kTurn_s);
  for (std::size_t i = 0; i + 2 < scan.ranges_m.size(); ++i) scan.ranges_m[i] = 0.0F;
  const auto added = std::make_shared<const Scan>(std::move(scan));
  pairing.Add(added);
  for (const Odometry& sample : Wheels(given.twist)) pairing.Add(sample);
  ASSERT_EQ(pairs.size(), 1U);
  EXPECT_EQ(pairs[0].at_stamp, added);
}

// The pairing waits for the odometry at the last beam, and no longer.
TEST(OdometryPairing, TakesTheMotionOutOfARollingScan) {
  std::vector<PairedScan> pairs;
  OdometryPairing pairing({}, {[&](PairedScan&& pair) { pairs.push_back(std::move(pair)); }, {}});
  const Case given;
  pairing.Add(std::make_shared<const Scan>(Measure(given, kTurn_s)));
  for (const Odometry& sample : Wheels(given.twist)) {
    EXPECT_TRUE(pairs.empty());
    pairing.Add(sample);
  }
  ASSERT_EQ(pairs.size(), 1U);
  EXPECT_GT(ShareThatAgrees(*pairs[0].at_stamp, Measure(given, 0.0)), 0.98);
}

// A log that ends within a scan.
TEST(OdometryPairing, TakesOutTheMotionThatIsKnownWhenNoMoreOdometryComes) {
  std::vector<PairedScan> pairs;
  OdometryPairing pairing({}, {[&](PairedScan&& pair) { pairs.push_back(std::move(pair)); }, {}});
  const Case given;
  pairing.Add(std::make_shared<const Scan>(Measure(given, kTurn_s)));
  for (const Odometry& sample : Wheels(given.twist)) {
    if (sample.stamp < kStart + Stamp{150'000'000}) pairing.Add(sample);
  }
  EXPECT_TRUE(pairs.empty());
  pairing.Finish();
  ASSERT_EQ(pairs.size(), 1U);
  EXPECT_GT(ShareThatAgrees(*pairs[0].at_stamp, Measure(given, 0.0)), 0.6);
}

// As at its stamp: over a longer gap nobody knows how the robot moved.
TEST(OdometryPairing, DropsARollingScanWithAGapInItsOdometry) {
  for (const double max_gap_s : {0.1, 0.2}) {
    int paired = 0, dropped = 0;
    OdometryPairing pairing({.max_gap_s = max_gap_s}, {[&](PairedScan&&) { ++paired; },
                                                       [&](const Scan&, DropReason reason) {
                                                         EXPECT_EQ(reason, DropReason::kNoOdometry);
                                                         ++dropped;
                                                       }});
    pairing.Add(std::make_shared<const Scan>(Measure({}, kTurn_s)));
    for (const Odometry& sample : Wheels({0.5, 1.2})) {
      const Stamp since = sample.stamp - kStart;  // Samples are missing well after the stamp.
      if (since < Stamp{20'000'000} || since > Stamp{140'000'000}) pairing.Add(sample);
    }
    EXPECT_EQ(paired, max_gap_s > 0.15 ? 1 : 0);
    EXPECT_EQ(dropped, max_gap_s > 0.15 ? 0 : 1);
  }
}

}  // namespace
}  // namespace cairn::slam
