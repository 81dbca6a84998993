#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/common/sensor/read_log.h"

namespace cairn {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(CarmenReader, FlaserYieldsOdometryThenScanOfTheSameStamp) {
  const auto log = ReadText("FLASER 4 1.0 2.5 81.91 3 7 8 0.5 7 8 0.5 976052857.337530 host 0.1\n");
  ASSERT_EQ(log.records.size(), 2u);
  const auto& odometry = std::get<Odometry>(log.records[0]);
  const auto& scan = std::get<Scan>(log.records[1]);
  EXPECT_EQ(odometry.stamp, 976052857337530000);
  EXPECT_EQ(scan.stamp, odometry.stamp);
  EXPECT_EQ(odometry.T_odom_robot, (Pose2{7, 8, 0.5}));
  EXPECT_THAT(scan.ranges_m, ElementsAre(1.0F, 2.5F, 81.91F, 3.0F));
  EXPECT_EQ(scan.T_robot_laser, Pose2{});
  EXPECT_EQ(scan.range_max_m, 80.0);
  EXPECT_EQ(log.summary.scans, 1);
  EXPECT_EQ(log.summary.odometries, 1);
  EXPECT_EQ(log.summary.complaint_count, 0);
}

std::string Flaser(int beams, const std::string& poses, const std::string& stamp) {
  std::string line = "FLASER " + std::to_string(beams);
  for (int i = 0; i < beams; ++i) line += " 1.5";
  return line + " " + poses + " " + stamp + " host 0\n";
}

TEST(CarmenReader, EvenCountsLeaveTheLastBeamOutOddCountsDoNot) {
  for (const int beams : {180, 360}) {
    const auto log = ReadText(Flaser(beams, "0 0 0 0 0 0", "1.0"));
    EXPECT_DOUBLE_EQ(log.scans.at(0).angle_first_rad, -kPi / 2);
    EXPECT_DOUBLE_EQ(log.scans.at(0).angle_step_rad, kPi / beams);
  }
  for (const int beams : {181, 361}) {
    const auto log = ReadText(Flaser(beams, "0 0 0 0 0 0", "1.0"));
    EXPECT_DOUBLE_EQ(log.scans.at(0).angle_first_rad, -kPi / 2);
    EXPECT_DOUBLE_EQ(log.scans.at(0).angle_step_rad, kPi / (beams - 1));
  }
}

TEST(CarmenReader, MountingFollowsFromTheTwoPoses) {
  // The laser sits 0.217 m ahead; the poses are printed with six decimals.
  const auto log = ReadText(Flaser(2, "1.217000 2.000000 0.0 1.000000 2.000000 0.0", "1.0") +
                            Flaser(2, "3.000000 4.217000 1.570796 3.000000 4.000000 1.570796", "2.0") +
                            Flaser(2, "2.783000 4.000000 3.141593 3.000000 4.000000 3.141593", "3.0"));
  for (const Scan& scan : log.scans) EXPECT_EQ(scan.T_robot_laser, (Pose2{0.217, 0, 0}));
}

TEST(CarmenReader, CorrectedLaserPosesAreNoMounting) {
  const auto log = ReadText(Flaser(2, "1.5 2.0 0.3 1 2 0", "1.0") + Flaser(2, "9.0 2.1 0.9 2 2 0", "2.0") +
                            Flaser(2, "7.7 3.3 0.1 3 2 0", "3.0"));
  for (const Scan& scan : log.scans) EXPECT_EQ(scan.T_robot_laser, Pose2{});
  EXPECT_THAT(log.summary.notes, testing::Contains(HasSubstr("no fixed mounting")));
}

TEST(CarmenReader, RearLaserLooksBack) {
  const auto log = ReadText("RLASER 2 1 2 -0.2 0 3.141593 0 0 0 1.0 host 0\n");
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_NEAR(log.scans[0].T_robot_laser.x, -0.2, 1e-9);
  EXPECT_NEAR(std::abs(log.scans[0].T_robot_laser.theta), kPi, 1e-4);
}

TEST(CarmenReader, OdometryOfOneStampComesOnce) {
  const auto log =
      ReadText("ODOM 1 2 0.5 0 0 0 5.000 h 0\n" + Flaser(2, "1 2 0.5 1 2 0.5", "5.0") + "ODOM 1 2 0.5 0 0 0 5 h 0\n");
  EXPECT_EQ(log.odometries.size(), 1u);
  EXPECT_EQ(log.scans.size(), 1u);
}

TEST(CarmenReader, RobotLaserCarriesItsOwnLayout) {
  const auto log = ReadText(
      "ROBOTLASER1 0 -2.0 4.0 2.0 30.5 0.01 0 3 1 2 3 2 0.1 0.2 1.1 1 0 1 1 0 0.3 0.1 0 0 0 12.000000001 host 1\n");
  ASSERT_EQ(log.scans.size(), 1u);
  const Scan& scan = log.scans[0];
  EXPECT_EQ(scan.stamp, 12'000'000'001);
  EXPECT_EQ(scan.angle_first_rad, -2.0);
  EXPECT_EQ(scan.angle_step_rad, 2.0);
  EXPECT_EQ(scan.range_max_m, 30.5);
  EXPECT_THAT(scan.ranges_m, ElementsAre(1.0F, 2.0F, 3.0F));
  EXPECT_EQ(scan.T_robot_laser, (Pose2{0.1, 0, 0}));
  ASSERT_EQ(log.odometries.size(), 1u);
  EXPECT_EQ(log.odometries[0].T_odom_robot, (Pose2{1, 1, 0}));
}

TEST(CarmenReader, RawLaserCarriesNoOdometry) {
  const auto log = ReadText("RAWLASER1 0 -1.5 3.0 1.5 81.9 0.01 0 3 1 2 3 0 7.5 host 1\n");
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_TRUE(log.odometries.empty());
  EXPECT_EQ(log.scans[0].range_max_m, 80.0);  // 81.9 m is how a SICK says 80 m.
  EXPECT_EQ(log.scans[0].T_robot_laser, Pose2{});
}

TEST(CarmenReader, TheSameSweepInTwoMessagesIsOneScan) {
  const std::string raw = "RAWLASER1 0 -1.5 3.0 1.5 81.9 0.01 0 3 1 2 3 0 7.5 host 1\n";
  const std::string robot = "ROBOTLASER1 0 -1.5 3.0 1.5 81.9 0.01 0 3 1 2 3 0 0 0 0 0 0 0 0 0 0 0 0 7.5 host 1\n";
  const std::string front = "FLASER 3 1 2 3 0 0 0 0 0 0 7.5 host 1\n";
  const auto both = ReadText(raw + robot);
  EXPECT_EQ(both.scans.size(), 1u);
  EXPECT_EQ(both.odometries.size(), 1u);
  EXPECT_EQ(both.summary.ignored, 1);
  EXPECT_EQ(ReadText(front + robot).scans.size(), 1u);
}

TEST(CarmenReader, OtherMessagesAreIgnoredAndCommentsAreNothing) {
  const auto log = ReadText("# a comment\n\nPARAM robot_length 0.5 1 host 1\nSYNC x\n" + Flaser(2, "0 0 0 0 0 0", "1") +
                            "TRUEPOS 1 2 3\r\n");
  EXPECT_EQ(log.summary.ignored, 3);
  EXPECT_EQ(log.summary.complaint_count, 0);
  EXPECT_EQ(log.summary.scans, 1);
}

TEST(CarmenReader, ReadsDosLineEndsAndALastLineWithoutOne) {
  const auto log = ReadText("ODOM 1 2 0.5 0 0 0 5.0 h 0\r\nODOM 1 2 0.5 0 0 0 6.0 h 0");
  EXPECT_EQ(log.odometries.size(), 2u);
  EXPECT_EQ(log.summary.complaint_count, 0);
}

TEST(CarmenReader, HeadingsAreWrapped) {
  const auto log = ReadText("ODOM 1 2 -4.0 0 0 0 5.0 h 0\n");
  EXPECT_NEAR(log.odometries.at(0).T_odom_robot.theta, 2 * kPi - 4.0, 1e-12);
}

TEST(CarmenReader, NanAndInfinityAreRanges) {
  const auto log = ReadText("FLASER 3 nan inf 1.0 0 0 0 0 0 0 1.0 h 0\n");
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_TRUE(std::isnan(log.scans[0].ranges_m[0]));
  EXPECT_TRUE(std::isinf(log.scans[0].ranges_m[1]));
}

TEST(CarmenReader, AnExplicitNoReturnRangeWins) {
  LogReaderOptions options;
  options.no_return_m = 20.0;
  EXPECT_EQ(ReadText(Flaser(2, "0 0 0 0 0 0", "1"), options).scans.at(0).range_max_m, 20.0);
}

TEST(CarmenReader, TheSinkCanStop) {
  const TempDirectory directory;
  const auto path = directory.Write("log.clf", "ODOM 1 2 0 0 0 0 5 h 0\nODOM 1 2 0 0 0 0 6 h 0\n");
  int seen = 0;
  const auto summary = ReadLog(path, {}, [&](LogRecord&&) { return ++seen < 1; });
  ASSERT_TRUE(summary);
  EXPECT_EQ(seen, 1);
  EXPECT_EQ(summary->odometries, 1);
}

}  // namespace
}  // namespace cairn
