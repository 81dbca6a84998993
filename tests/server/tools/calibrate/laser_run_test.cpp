#include "server/tools/calibrate/laser_run.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iostream>

#include "client/sim/laser_models.h"
#include "common/options/config.h"
#include "server/slam/mapper_options.h"
#include "tests/real_logs.h"
#include "tests/server/tools/calibrate/handed_over_drive.h"
#include "tests/temp_directory.h"

namespace cairn::server {
namespace {

using enum slam::LaserUnknown;

Result<LaserReport> ReportOf(const test::HandedOverDrive& drive) {
  const TempDirectory directory;
  LaserRunOptions options;
  options.log = directory / "drive.log";
  options.fit.pairs_along = 150;
  options.fit.pairs_turning = 40;
  options.threads = 1;
  std::ofstream log(options.log);
  test::WriteHandedOver(drive, log);
  log.close();
  auto report = RunLaser(options);
  if (report) std::cout << ReportText(*report);
  return report;
}

test::HandedOverDrive DriveWith(const std::string& model) {
  test::HandedOverDrive drive;
  const auto modelled = sim::WithModel({}, model);
  drive.robot.robots = 1;
  drive.robot.laser = modelled->laser;
  drive.robot.scan_hz = modelled->scan_hz;
  drive.robot.wheel_spread = {0.0, 0.0};  // What is injected is all there is.
  return drive;
}

// Everything at once is wrong: what a person knows of a new robot with a cheap lidar. Stated bounds: turn time within
// 3 %, its begin 4 deg, lag 10 ms, wheels 0.8 % (0.005 rad a metre), mounting 1 cm and 0.5 deg.
TEST(LaserRun, RecoversWhatNobodyKnows) {
  test::HandedOverDrive drive = DriveWith("rplidar-a1");
  drive.world = "room";
  drive.seconds = 150.0;
  drive.lag_s = 0.12;
  drive.robot.laser.T_robot_laser = {0.10, -0.04, Radians(5.0)};
  drive.wheels = {1.04, 0.95, 0.02};
  const auto report = ReportOf(drive);
  ASSERT_TRUE(report) << report.error().message;
  const slam::LaserFit& fit = report->fit;
  ASSERT_TRUE(fit.turn.shown());
  EXPECT_TRUE(*fit.timing.clockwise);
  EXPECT_NEAR(*fit.timing.scan_period_s, 1.0 / 5.5, 0.03 / 5.5);
  EXPECT_NEAR(std::abs(Degrees(*fit.timing.turn_from_rad)), 180.0, 4.0);
  EXPECT_EQ(fit.timing.stamp_at, StampAt::kLast);
  EXPECT_NEAR(fit.lag_s, 0.12, 0.01);
  const slam::MountingFit& mounting = fit.mounting;
  for (const auto what : {kLag, kWheelScale, kTurnScale, kTurnPerM, kX, kY, kHeading})
    EXPECT_TRUE(mounting.Shows(what));
  EXPECT_NEAR(mounting.wheels.wheel_scale, 1.04, 0.008);
  EXPECT_NEAR(mounting.wheels.turn_scale, 0.95, 0.008);
  EXPECT_NEAR(mounting.wheels.turn_per_m, 0.02, 0.005);
  EXPECT_NEAR(mounting.T_robot_laser.x, 0.10, 0.01);
  EXPECT_NEAR(mounting.T_robot_laser.y, -0.04, 0.01);
  EXPECT_NEAR(Degrees(mounting.T_robot_laser.theta), 5.0, 0.5);

  // What is written is what the estimator reads.
  const auto yaml = ReportConfig(*report);
  ASSERT_TRUE(yaml);
  EXPECT_NE(yaml->find("--clockwise"), std::string::npos);
  slam::MapperOptions estimator;
  ASSERT_TRUE(ApplyYaml(*yaml, "robot.yaml", [&](OptionVisitor& visitor) {
    visitor.Section("slam", "", [&] { slam::Visit(visitor, estimator); });
  }));
  EXPECT_NEAR(estimator.pairing.laser_lag_s, fit.lag_s, 0.0005);
  EXPECT_EQ(estimator.pairing.wheels, mounting.wheels);
  // And nothing else, so that it leaves the rest of a configuration as it is.
  for (const char* what : {"laser_lag_s", "wheel_scale", "turn_scale", "turn_per_m"})
    EXPECT_THAT(*yaml, ::testing::ContainsRegex("# Measured, \\+- [0-9.e-]+\\.\n *" + std::string(what) + ": "));
  for (const char* what : {"max_gap_s", "max_speed_m_s", "rolling", "expert"})
    EXPECT_EQ(yaml->find(what), std::string::npos) << *yaml;
}

// A lidar that measures all beams at once is not said to turn.
TEST(LaserRun, AScanAtOnceShowsNoTurn) {
  test::HandedOverDrive drive = DriveWith("lms200");
  drive.robot.scan_hz = 10.0;
  drive.lag_s = -0.06;
  const auto report = ReportOf(drive);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_FALSE(report->fit.turn.shown());
  EXPECT_NEAR(report->fit.lag_s, -0.06, 0.01);
  EXPECT_EQ(report->log_options.find("--scan-period"), std::string::npos);
}

// A robot that only drives straight ahead shows neither how its lidar turns nor where it is mounted.
TEST(LaserRun, SaysWhatTheLogDoesNotShow) {
  test::HandedOverDrive drive = DriveWith("rplidar-a1");
  drive.seconds = 12.0;
  drive.T_robot_laser_logged = {0.3, 0.1, 0.0};
  drive.robot.laser.T_robot_laser = {0.0, 0.0, 0.0};
  const TempDirectory directory;
  std::ofstream(directory / "straight.yaml")
      << "cairn-world: 1\nlines:\n  - {points: [[-2, -2], [20, -2], [20, 2.5], [-2, 2.5]], closed: true}\n"
         "boxes:\n  - {center: [3, 1.8], size: [0.6, 0.5]}\n  - {center: [7, -1.6], size: [0.8, 0.5], degrees: 20}\n"
         "routes:\n  - {name: straight, points: [[0, 0], [18, 0]]}\n";
  drive.world = directory / "straight.yaml";
  const auto report = ReportOf(drive);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_FALSE(report->fit.turn.shown());
  EXPECT_FALSE(report->fit.mounting.Shows(kX));
  EXPECT_FALSE(report->fit.mounting.Shows(kTurnScale));
  EXPECT_FALSE(report->fit.mounting.Shows(kLag));
  EXPECT_EQ(report->fit.lag_s, 0.0);
  EXPECT_EQ(report->fit.mounting.T_robot_laser.x, 0.3);
  EXPECT_NE(ReportText(*report).find("not shown: the robot must turn"), std::string::npos);
}

TEST(LaserRun, ARobotThatStandsIsRefused) {
  test::HandedOverDrive drive = DriveWith("xv11");
  drive.seconds = 5.0;
  drive.robot.drive.speed_m_s = 0.05;
  const auto report = ReportOf(drive);
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, StatusCode::kFailedPrecondition);
}

// The layout of these robots' lidars is written in the description of the logs.
TEST(LaserRun, FindsHowRealLidarsTurn) {
  CAIRN_NEED_LOG(maebot, "lowcost/maebot_rplidara1_convex.log");
  LaserRunOptions options;
  options.log = maebot;
  options.fit.pairs_along = 150;
  options.fit.pairs_turning = 40;
  options.threads = 1;
  const auto report = RunLaser(options);
  ASSERT_TRUE(report) << report.error().message;
  ASSERT_TRUE(report->fit.turn.shown());
  EXPECT_TRUE(*report->fit.timing.clockwise);
  EXPECT_NEAR(*report->fit.timing.scan_period_s, 0.147, 0.005);
  EXPECT_NEAR(Degrees(*report->fit.timing.turn_from_rad), 0.0, 5.0);
  EXPECT_EQ(report->fit.timing.stamp_at, StampAt::kMiddle);
  EXPECT_NEAR(report->fit.lag_s, 0.0, 0.02);
}

}  // namespace
}  // namespace cairn::server
