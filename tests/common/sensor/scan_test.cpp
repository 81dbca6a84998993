#include "common/sensor/scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

namespace cairn {
namespace {

constexpr float kNanF = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfF = std::numeric_limits<float>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

Scan GoodScan() {
  Scan scan;
  scan.angle_first_rad = -kPi / 2;
  scan.angle_step_rad = kPi / 180;
  scan.range_max_m = 80;
  scan.ranges_m.assign(180, 2.0F);
  return scan;
}

TEST(ClassifyRange, TellsHitsFromNothingAndNonsense) {
  EXPECT_EQ(ClassifyRange(2.0F, 0.1, 30.0), BeamClass::kHit);
  EXPECT_EQ(ClassifyRange(30.0F, 0.1, 30.0), BeamClass::kNoReturn);
  EXPECT_EQ(ClassifyRange(kInfF, 0.1, 30.0), BeamClass::kNoReturn);
  for (const float range : {kNanF, -kInfF, -1.0F, 0.0F, 0.05F}) {
    EXPECT_EQ(ClassifyRange(range, 0.1, 30.0), BeamClass::kInvalid) << range;
  }
}

TEST(ClassifyRange, ZeroIsInvalidEvenWithoutAMinimum) {
  EXPECT_EQ(ClassifyRange(0.0F, 0.0, 30.0), BeamClass::kInvalid);
}

TEST(ValidateScan, AcceptsAnOrdinaryScan) {
  EXPECT_TRUE(ValidateScan(GoodScan()));
}

TEST(ValidateScan, AcceptsAFullTurnBothWays) {
  Scan scan = GoodScan();
  scan.ranges_m.assign(361, 2.0F);
  scan.angle_step_rad = 2 * kPi / 360;
  EXPECT_TRUE(ValidateScan(scan));
  scan.angle_step_rad = -scan.angle_step_rad;
  EXPECT_TRUE(ValidateScan(scan));
}

TEST(ValidateScan, BadSingleRangesAreNormal) {
  Scan scan = GoodScan();
  scan.ranges_m.assign(180, kNanF);
  scan.ranges_m[17] = 3.0F;
  EXPECT_TRUE(ValidateScan(scan));
  scan.ranges_m[17] = kInfF;  // "Nothing hit" is usable too.
  EXPECT_TRUE(ValidateScan(scan));
}

TEST(ValidateScan, TakesTheMostBeamsAndNotOneMore) {
  Scan scan = GoodScan();
  scan.angle_step_rad = 2 * kPi / kMaxBeams;
  scan.ranges_m.assign(kMaxBeams, 1.0F);
  EXPECT_TRUE(ValidateScan(scan));
  scan.ranges_m.push_back(1.0F);
  EXPECT_THAT(ValidateScan(scan).error().message, testing::HasSubstr("8193 beams"));
  EXPECT_EQ(ValidateScan(scan).error().fault, ScanFault::kTooManyBeams);
}

struct Fault {
  const char* name;
  std::function<void(Scan&)> apply;
  const char* reason;
  ScanFault fault = ScanFault::kBadGeometry;
};

class FaultyScan : public testing::TestWithParam<Fault> {};

TEST_P(FaultyScan, IsRefusedWithItsReason) {
  Scan scan = GoodScan();
  GetParam().apply(scan);
  const auto result = ValidateScan(scan);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().fault, GetParam().fault);
  EXPECT_THAT(result.error().message, testing::HasSubstr(GetParam().reason));
}

TEST(Scan, BeamsThatAreListedLastFirstAreOrderedByTheirTimes) {
  Scan listed;
  listed.stamp = 2 * kNanosPerSecond;
  listed.angle_first_rad = -1.0;
  listed.angle_step_rad = 0.5;
  listed.beam_period_s = -0.25;
  listed.ranges_m = {1.0F, 2.0F, 3.0F};
  Scan ordered = listed;
  OrderByTime(ordered);
  EXPECT_EQ(ordered.beam_period_s, 0.25);
  for (std::size_t i = 0; i < 3; ++i) {
    const double listed_i = static_cast<double>(i), ordered_i = static_cast<double>(2 - i);
    EXPECT_EQ(ordered.ranges_m[2 - i], listed.ranges_m[i]);
    EXPECT_DOUBLE_EQ(ordered.angle_first_rad + ordered_i * ordered.angle_step_rad,
                     listed.angle_first_rad + listed_i * listed.angle_step_rad);
    EXPECT_DOUBLE_EQ(SecondsFromStamp(ordered.stamp) + ordered_i * ordered.beam_period_s,
                     SecondsFromStamp(listed.stamp) + listed_i * listed.beam_period_s);
  }
  const auto stays = [](const Scan& scan) {
    Scan again = scan;
    OrderByTime(again);
    return again.stamp == scan.stamp && again.angle_step_rad == scan.angle_step_rad && again.ranges_m == scan.ranges_m;
  };
  EXPECT_TRUE(stays(ordered));
  listed.stamp = std::numeric_limits<Stamp>::min();
  EXPECT_TRUE(stays(listed)) << "no stamp is so early";
  listed.stamp = 100 * kNanosPerSecond;
  listed.beam_period_s = -6.0;
  EXPECT_TRUE(stays(listed)) << "too long, to be refused";
  listed.beam_period_s = -std::numeric_limits<double>::infinity();
  EXPECT_TRUE(stays(listed));
  listed.ranges_m.clear();
  EXPECT_TRUE(stays(listed));
}

INSTANTIATE_TEST_SUITE_P(
    Faults, FaultyScan,
    testing::Values(Fault{"NoBeams", [](Scan& s) { s.ranges_m.clear(); }, "no beams", ScanFault::kEmpty},
                    Fault{"NothingUsable", [](Scan& s) { s.ranges_m.assign(5, kNanF); }, "usable", ScanFault::kEmpty},
                    Fault{"FirstAngleNan", [](Scan& s) { s.angle_first_rad = kNan; }, "first beam"},
                    Fault{"FirstAngleHuge", [](Scan& s) { s.angle_first_rad = 1e9; }, "first beam"},
                    Fault{"StepZero", [](Scan& s) { s.angle_step_rad = 0; }, "step"},
                    Fault{"StepTiny", [](Scan& s) { s.angle_step_rad = -1e-300; }, "step"},
                    Fault{"StepInfinite", [](Scan& s) { s.angle_step_rad = kInf; }, "step"},
                    Fault{"MoreThanATurn", [](Scan& s) { s.angle_step_rad = 0.04; }, "field of view"},
                    Fault{"RangeMinNegative", [](Scan& s) { s.range_min_m = -1; }, "range_min"},
                    Fault{"RangeMinNan", [](Scan& s) { s.range_min_m = kNan; }, "range_min"},
                    Fault{"RangeMaxInfinite", [](Scan& s) { s.range_max_m = kInf; }, "range_max"},
                    Fault{"RangesSwapped", [](Scan& s) { s.range_min_m = 81; }, "range_max"},
                    Fault{"BeamPeriodNegative", [](Scan& s) { s.beam_period_s = -1e-3; }, "beam period"},
                    Fault{"LooksAtItsFeet", [](Scan& s) { s.tilt_rad = kPi / 2; }, "tilt"},
                    Fault{"TiltNan", [](Scan& s) { s.tilt_rad = kNan; }, "tilt"},
                    Fault{"MountingNan", [](Scan& s) { s.T_robot_laser.theta = kNan; }, "mounting"},
                    Fault{"MountingFar", [](Scan& s) { s.T_robot_laser.x = 101; }, "mounting"}),
    [](const auto& fault) { return std::string(fault.param.name); });

}  // namespace
}  // namespace cairn
