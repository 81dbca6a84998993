// When the beams of a logged scan were measured: from a person's word, or from the log's.
#include "common/sensor/lidar_timing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>

#include "common/sensor/carmen_writer.h"
#include "tests/common/sensor/read_log.h"

namespace cairn {
namespace {

// Ranges 1, 2, 3, ... in the order of the array.
Scan Logged(double first_deg, double step_deg, std::size_t beams) {
  Scan scan;
  scan.stamp = 100 * kNanosPerSecond;
  scan.angle_first_rad = Radians(first_deg);
  scan.angle_step_rad = Radians(step_deg);
  scan.range_max_m = 1000.0;
  scan.ranges_m.resize(beams);
  std::iota(scan.ranges_m.begin(), scan.ranges_m.end(), 1.0F);
  return scan;
}

void Set(LidarTiming& timing, std::string_view name, std::string_view value) {
  const auto set = SetLidarTiming(timing, name, value);
  EXPECT_TRUE(set) << set.error().message;
}

// Each beam keeps its direction, whatever its new place in the array is.
void ExpectDirections(const Scan& timed, const Scan& logged) {
  for (std::size_t i = 0; i < timed.ranges_m.size(); ++i) {
    if (std::isnan(timed.ranges_m[i])) continue;
    const double before = logged.angle_first_rad + (timed.ranges_m[i] - 1.0) * logged.angle_step_rad;
    const double now = timed.angle_first_rad + static_cast<double>(i) * timed.angle_step_rad;
    EXPECT_NEAR(WrapAngle(now - before), 0.0, 1e-9) << i;
  }
}

TEST(LidarTiming, WithoutAPeriodAScanStaysAsItIs) {
  LidarTiming timing;
  Set(timing, "stamp-at", "last");
  Set(timing, "clockwise", "on");
  Set(timing, "turn-from", "90");
  const Scan logged = Logged(-180, 1, 360);
  for (const char* period : {"", "0"}) {
    if (*period != '\0') Set(timing, "scan-period", period);
    Scan scan = logged;
    ASSERT_TRUE(PutInOrderOfTime(timing, scan));
    EXPECT_EQ(scan.ranges_m, logged.ranges_m);
    EXPECT_EQ(scan.stamp, logged.stamp);
    EXPECT_EQ(scan.beam_period_s, 0.0);
  }
}

// As in a bag whose driver says how long a turn takes, and stamps its end.
TEST(LidarTiming, AScanThatSaysItsPeriodItselfIsPutInOrderWithoutOne) {
  Scan logged = Logged(-180, 1, 360);
  logged.beam_period_s = 0.0005;
  Scan scan = logged;
  ASSERT_TRUE(PutInOrderOfTime({}, scan));
  EXPECT_EQ(scan.stamp, logged.stamp);
  LidarTiming timing;
  Set(timing, "stamp-at", "last");
  ASSERT_TRUE(PutInOrderOfTime(timing, scan));
  EXPECT_NEAR(scan.beam_period_s, 0.0005, 1e-12);
  EXPECT_EQ(logged.stamp - scan.stamp, 179'500'000);
  EXPECT_EQ(scan.ranges_m, logged.ranges_m);
  scan = logged;
  Set(timing, "scan-period", "0");
  ASSERT_TRUE(PutInOrderOfTime(timing, scan));
  EXPECT_EQ(scan.stamp, logged.stamp) << "all at once was asked for";
}

// The array runs counter-clockwise from -180 deg, while the lidar turned clockwise from straight ahead.
TEST(LidarTiming, AnArrayThatWasTurnedOverIsPutInOrderOfTime) {
  LidarTiming timing;
  Set(timing, "scan-period", "0.18");
  Set(timing, "stamp-at", "middle");
  Set(timing, "clockwise", "on");
  Set(timing, "turn-from", "0");
  const Scan logged = Logged(-180, 1, 360);
  Scan scan = logged;
  ASSERT_TRUE(PutInOrderOfTime(timing, scan));
  EXPECT_NEAR(scan.angle_first_rad, 0.0, 1e-9);
  EXPECT_NEAR(scan.angle_step_rad, -Radians(1), 1e-12);
  EXPECT_EQ(scan.ranges_m[0], 181.0F);
  EXPECT_EQ(scan.ranges_m[1], 180.0F);
  EXPECT_EQ(scan.ranges_m[180], 1.0F);
  EXPECT_EQ(scan.ranges_m[181], 360.0F);
  EXPECT_EQ(scan.ranges_m[359], 182.0F);
  EXPECT_NEAR(scan.beam_period_s, 0.0005, 1e-12);
  EXPECT_EQ(logged.stamp - scan.stamp, 89'750'000);
  ExpectDirections(scan, logged);
  EXPECT_TRUE(ValidateScan(scan));
}

TEST(LidarTiming, ATurnMayBeginAnywhereAndGoEitherWay) {
  for (const double from_deg : {-360.0, -179.6, -90.0, -0.2, 0.0, 33.3, 179.9, 270.0}) {
    for (const bool clockwise : {false, true}) {
      for (const double step_deg : {1.0, -1.0}) {
        const Scan logged = Logged(step_deg > 0 ? -180 : 179, step_deg, 360);
        Scan scan = logged;
        ASSERT_TRUE(PutInOrderOfTime({0.1, StampAt::kFirst, clockwise, Radians(from_deg)}, scan));
        EXPECT_EQ(scan.ranges_m.size(), 360U);
        EXPECT_EQ(scan.angle_step_rad < 0.0, clockwise);
        EXPECT_LE(std::abs(WrapAngle(scan.angle_first_rad - Radians(from_deg))), Radians(0.501)) << from_deg;
        EXPECT_EQ(scan.stamp, logged.stamp);
        ExpectDirections(scan, logged);
      }
    }
  }
}

// A crop of what a lidar saw that begins its turn straight ahead: between the two halves it saw nothing that was kept.
TEST(LidarTiming, APartOfATurnIsCutWhereTheTurnBegins) {
  const Scan logged = Logged(-90, 2, 91);
  Scan scan = logged;
  ASSERT_TRUE(PutInOrderOfTime({0.18, StampAt::kLast, std::nullopt, 0.0}, scan));
  ASSERT_EQ(scan.ranges_m.size(), 180U);
  EXPECT_EQ(scan.ranges_m[0], 46.0F);
  EXPECT_EQ(scan.ranges_m[45], 91.0F);
  EXPECT_TRUE(std::isnan(scan.ranges_m[46]));
  EXPECT_EQ(scan.ranges_m[135], 1.0F);
  EXPECT_EQ(scan.ranges_m[179], 45.0F);
  EXPECT_EQ(logged.stamp - scan.stamp, 179'000'000);
  ExpectDirections(scan, logged);
}

// The turn begins where no beam is: the array is in order of time as it is, or turned over.
TEST(LidarTiming, ATurnThatBeginsOutsideTheViewCutsNothing) {
  for (const bool clockwise : {false, true}) {
    Scan scan = Logged(-120, 0.3515625, 683);
    ASSERT_TRUE(PutInOrderOfTime({0.1, StampAt::kFirst, clockwise, kPi}, scan));
    EXPECT_EQ(scan.ranges_m.size(), 683U);
    EXPECT_EQ(scan.ranges_m.front(), clockwise ? 683.0F : 1.0F);
    EXPECT_NEAR(scan.beam_period_s, 0.1 / 1024, 1e-12);
  }
}

TEST(LidarTiming, ABeamThatRepeatsTheFirstOneIsLeftOutWhereTheTurnIsCut) {
  Scan scan = Logged(-180, 1, 361);
  ASSERT_TRUE(PutInOrderOfTime({0.1, StampAt::kFirst, false, 0.0}, scan));
  EXPECT_EQ(scan.ranges_m.size(), 360U);
  EXPECT_TRUE(ValidateScan(scan));
}

TEST(LidarTiming, BeamsOnNoGridOfATurnAreNotJoined) {
  const Scan logged = Logged(-100, 0.7, 286);
  Scan scan = logged;
  EXPECT_FALSE(PutInOrderOfTime({0.1, StampAt::kLast, true, 0.0}, scan));
  EXPECT_EQ(scan.ranges_m, logged.ranges_m);
  EXPECT_EQ(scan.stamp, logged.stamp);
}

TEST(LidarTiming, AScanOfAnyAnglesIsNoProblem) {
  const double odd[] = {0.0, std::numeric_limits<double>::quiet_NaN(), 1e300, -1e300, 1e-300, 3.0};
  for (const double first : odd) {
    for (const double step : odd) {
      Scan scan = Logged(0, 1, 5);
      scan.angle_first_rad = first;
      scan.angle_step_rad = step;
      scan.stamp = std::numeric_limits<Stamp>::min();
      (void)PutInOrderOfTime({10.0, StampAt::kLast, true, 1.0}, scan);
      EXPECT_LE(scan.ranges_m.size(), static_cast<std::size_t>(kMaxBeams));
    }
  }
}

TEST(LidarTiming, RefusesWhatIsNoValue) {
  LidarTiming timing;
  for (const auto& [name, value] : std::initializer_list<std::pair<const char*, const char*>>{{"scan-period", "-1"},
                                                                                              {"scan-period", "nan"},
                                                                                              {"scan-period", "11"},
                                                                                              {"scan-period", "x"},
                                                                                              {"stamp-at", "end"},
                                                                                              {"clockwise", "yes"},
                                                                                              {"turn-from", "361"},
                                                                                              {"turn-from", "inf"},
                                                                                              {"tilt", "1"}}) {
    EXPECT_FALSE(SetLidarTiming(timing, name, value)) << name << " " << value;
  }
  EXPECT_FALSE(timing.scan_period_s || timing.stamp_at || timing.clockwise || timing.turn_from_rad);
}

constexpr char kScanLine[] =
    "ROBOTLASER1 0 -1.5707963267948966 3.141592653589793 1.5707963267948966 8 0.01 0 3 1 2 3 0 "
    "0 0 0 0 0 0 0 0 0 0 0 100 host 1\n";

TEST(LidarTiming, ALogSaysItForTheScansThatFollow) {
  const auto log = ReadText(std::string(kScanLine) +
                            "PARAM lidar_scan_period 0.4 1 host 1\nPARAM lidar_stamp_at last\n"
                            "PARAM lidar_clockwise on\nPARAM lidar_colour red\nPARAM lidar_turn_from x\n" +
                            std::string(kScanLine).replace(std::string(kScanLine).find(" 100 "), 5, " 101 "));
  ASSERT_EQ(log.scans.size(), 2U);
  EXPECT_EQ(log.scans[0].beam_period_s, 0.0);
  EXPECT_NEAR(log.scans[1].beam_period_s, 0.1, 1e-12);
  EXPECT_EQ(log.scans[1].stamp, 101 * kNanosPerSecond - 200'000'000);
  EXPECT_EQ(log.scans[1].ranges_m, (std::vector<float>{3, 2, 1}));
  EXPECT_EQ(log.summary.complaint_count, 1);
  EXPECT_EQ(log.summary.ignored, 1);
}

TEST(LidarTiming, WhatAPersonSaysCountsBeforeTheLog) {
  LogReaderOptions options;
  options.timing.scan_period_s = 0.2;
  options.timing.clockwise = false;
  const auto log = ReadText(
      "PARAM lidar_scan_period 0.4\nPARAM lidar_stamp_at middle\nPARAM lidar_clockwise on\n" + std::string(kScanLine),
      options);
  ASSERT_EQ(log.scans.size(), 1U);
  EXPECT_NEAR(log.scans[0].beam_period_s, 0.05, 1e-12);
  EXPECT_EQ(log.scans[0].stamp, 100 * kNanosPerSecond - 50'000'000);
  EXPECT_EQ(log.scans[0].ranges_m, (std::vector<float>{1, 2, 3}));
}

TEST(LidarTiming, WhatIsWrittenIsReadBack) {
  std::ostringstream text;
  CarmenWriter writer(text);
  Scan scan = Logged(90, -1, 181);
  for (const double period : {1e-3, 1e-3, 0.0, 5e-4}) {
    scan.beam_period_s = period;
    scan.stamp += kNanosPerSecond;
    writer.Write(scan, {});
  }
  const auto log = ReadText(text.str());
  ASSERT_EQ(log.scans.size(), 4U);
  for (const std::size_t i : {0, 1, 2, 3}) EXPECT_EQ(log.scans[i].stamp, (101 + Stamp(i)) * kNanosPerSecond);
  EXPECT_NEAR(log.scans[1].beam_period_s, 1e-3, 1e-12);
  EXPECT_EQ(log.scans[2].beam_period_s, 0.0);
  EXPECT_NEAR(log.scans[3].beam_period_s, 5e-4, 1e-12);
  EXPECT_EQ(log.scans[0].ranges_m, scan.ranges_m);
}

}  // namespace
}  // namespace cairn
