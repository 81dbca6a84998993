#include "client/cli/turn_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <variant>
#include <vector>

#include "client/cli/log_check.h"
#include "client/sim/fleet.h"
#include "client/sim/laser_models.h"
#include "client/sim/shipped_worlds.h"

namespace cairn::client {
namespace {

// A minute of a robot with a lidar that turns round; the stamps of its scans are late.
std::vector<LogRecord> Drive(double lag_s) {
  sim::FleetOptions options;
  options.robots = 1;
  options.laser = sim::WithModel({}, "ld19")->laser;
  options.laser.sweep_s = 0.0;
  auto fleet = sim::Fleet::Create(*sim::OpenWorld("office"), options);
  std::vector<LogRecord> records;
  for (int i = 0; i < 3600; ++i) records.push_back(fleet->Next().record);
  const auto stamp_of = [](const LogRecord& record) {
    return std::visit([](const auto& value) { return value.stamp; }, record);
  };
  for (LogRecord& record : records)
    if (auto* scan = std::get_if<Scan>(&record)) scan->stamp += StampFromSeconds(lag_s);
  std::stable_sort(records.begin(), records.end(),
                   [&](const LogRecord& a, const LogRecord& b) { return stamp_of(a) < stamp_of(b); });
  return records;
}

TurnFinding TurnsOf(const std::vector<LogRecord>& records) {
  TurnCheck check;
  for (const LogRecord& record : records) std::visit([&](const auto& value) { check.Add(value); }, record);
  return check.Finish();
}

std::string Warnings(const std::vector<LogRecord>& records) {
  LogCheck check;
  for (const LogRecord& record : records) check.Add(record);
  std::string text;
  for (const Finding& finding : check.Finish({}).findings) text += finding.what + "; ";
  return text;
}

TEST(TurnCheck, OdometryThatStandsWhileTheScansMoveIsAnError) {
  std::vector<LogRecord> records = Drive(0.0);
  EXPECT_LT(TurnsOf(records).turned_while_standing_rad, 0.2);
  for (LogRecord& record : records)
    if (auto* odometry = std::get_if<Odometry>(&record)) odometry->T_odom_robot = {};
  EXPECT_GT(TurnsOf(records).turned_while_standing_rad, 1.0);
  LogCheck check;
  for (const LogRecord& record : records) check.Add(record);
  const LogReport report = check.Finish({});
  EXPECT_TRUE(report.has_errors());
  EXPECT_TRUE(std::any_of(report.findings.begin(), report.findings.end(), [](const Finding& finding) {
    return finding.error && finding.what.find("does not move although the scans do") != std::string::npos;
  }));
}

TEST(TurnCheck, FindsTheLag) {
  for (const double lag_s : {0.0, 0.16, -0.1}) {
    const TurnFinding finding = TurnsOf(Drive(lag_s));
    EXPECT_GT(finding.pairs, 40u);  // Those in which the robot turned.
    EXPECT_GT(finding.correlation, 0.9);
    EXPECT_NEAR(finding.lag_s, lag_s, 0.031) << lag_s;
  }
}

TEST(TurnCheck, TheLogCheckWarns) {
  const auto good = Drive(0.0);
  EXPECT_THAT(Warnings(good), testing::HasSubstr("nothing says when the beams"));
  EXPECT_THAT(Warnings(good), testing::Not(testing::HasSubstr("than the odometry")));
  EXPECT_THAT(Warnings(Drive(0.16)), testing::HasSubstr("s later than the odometry"));
  auto alone = good;
  std::erase_if(alone, [](const LogRecord& record) { return std::holds_alternative<Odometry>(record); });
  EXPECT_THAT(Warnings(alone), testing::HasSubstr("nothing says when the beams"))
      << "nothing says that it does not turn";
}

TEST(TurnCheck, AnArrayThatIsTurnedOverTurnsAgainstTheOdometry) {
  auto records = Drive(0.0);
  for (LogRecord& record : records)
    if (auto* scan = std::get_if<Scan>(&record)) std::reverse(scan->ranges_m.begin(), scan->ranges_m.end());
  EXPECT_LT(TurnsOf(records).correlation, -0.8);
  EXPECT_THAT(Warnings(records), testing::HasSubstr("turn against the odometry"));
}

TEST(TurnCheck, AFewScansSayNothing) {
  auto records = Drive(0.0);
  records.resize(60);
  EXPECT_EQ(TurnsOf(records).correlation, 0.0);
}

}  // namespace
}  // namespace cairn::client
