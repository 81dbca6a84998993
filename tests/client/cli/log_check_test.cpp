#include "client/cli/log_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "client/cli/json_output.h"
#include "client/cli/text_output.h"
#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

std::vector<LogRecord> GoodLog() {
  sim::FleetOptions options;
  options.robots = 1;
  options.laser.beams = 181;
  options.laser.field_of_view_rad = kPi;
  auto fleet = sim::Fleet::Create(*sim::OpenWorld("building"), options);
  std::vector<LogRecord> records;
  for (int i = 0; i < 1200; ++i) records.push_back(fleet->Next().record);  // 20 s.
  return records;
}

LogReport Check(const std::vector<LogRecord>& records, const LogSummary& summary = {}) {
  LogCheck check;
  for (const LogRecord& record : records) check.Add(record);
  return check.Finish(summary);
}

Scan& NthScan(std::vector<LogRecord>& records, int n) {
  for (LogRecord& record : records) {
    if (auto* scan = std::get_if<Scan>(&record); scan && n-- == 0) return *scan;
  }
  throw std::out_of_range("no such scan");
}

std::string Errors(const LogReport& report) {
  std::string text;
  for (const Finding& finding : report.findings) {
    if (finding.error) text += finding.what + "; ";
  }
  return text;
}

TEST(LogCheck, AGoodLogIsGood) {
  const LogReport report = Check(GoodLog());
  EXPECT_FALSE(report.has_errors()) << Errors(report);
  EXPECT_NEAR(report.scans.rate_hz, 10.0, 1e-6);
  EXPECT_NEAR(report.odometry.rate_hz, 50.0, 1e-6);
  EXPECT_EQ(report.beam_counts.size(), 1u);
  EXPECT_NEAR(Degrees(report.field_of_view_rad), 180.0, 1e-9);
  EXPECT_GT(report.hit_share, 0.9);
  EXPECT_NEAR(report.hit_share + report.no_return_share + report.invalid_share, 1.0, 1e-12);
  EXPECT_GT(report.way_m, 5.0);
  EXPECT_LT(report.fastest_m_s, 1.2);
  EXPECT_THAT(FormatLogReport(report), HasSubstr("good for mapping"));
  EXPECT_EQ(nlohmann::json(report)["good"], true);
}

TEST(LogCheck, StampsThatRepeatOrGoBackAreErrors) {
  auto records = GoodLog();
  NthScan(records, 10).stamp = NthScan(records, 9).stamp;
  NthScan(records, 20).stamp -= kNanosPerSecond;
  const LogReport report = Check(records);
  EXPECT_EQ(report.scans.repeated, 1u);
  EXPECT_EQ(report.scans.went_back, 1u);
  EXPECT_THAT(Errors(report), HasSubstr("1 scans repeat the stamp"));
  EXPECT_THAT(Errors(report), HasSubstr("1 scans are older"));
}

TEST(LogCheck, ScansTheServerWouldRefuseAreErrors) {
  auto records = GoodLog();
  NthScan(records, 3).ranges_m.clear();
  NthScan(records, 4).angle_step_rad = std::nan("");
  const LogReport report = Check(records);
  EXPECT_TRUE(report.has_errors());
  EXPECT_EQ(report.refused.size(), 2u);
  EXPECT_EQ(report.beam_counts.size(), 2u);
}

TEST(LogCheck, MissingStreamsAreErrors) {
  EXPECT_THAT(Errors(Check({})), HasSubstr("no scan"));
  std::vector<LogRecord> scans;
  for (const LogRecord& record : GoodLog()) {
    if (std::holds_alternative<Scan>(record)) scans.push_back(record);
  }
  const LogReport alone = Check(scans);
  EXPECT_FALSE(alone.has_errors()) << Errors(alone);
  EXPECT_THAT(FormatLogReport(alone), HasSubstr("no odometry: the robot is followed by its scans alone"));
}

TEST(LogCheck, GapsAndJumpsAreWorthKnowing) {
  auto records = GoodLog();
  for (LogRecord& record : records) {
    std::visit(
        [](auto& value) {
          if (SecondsFromStamp(value.stamp - 1'700'000'000'000'000'000) > 10) value.stamp += 30 * kNanosPerSecond;
        },
        record);
    if (auto* odometry = std::get_if<Odometry>(&record); odometry && odometry->sequence > 200)
      odometry->T_odom_robot.x += 40;
  }
  const LogReport report = Check(records);
  EXPECT_FALSE(report.has_errors()) << Errors(report);
  EXPECT_EQ(report.scans.gaps, 1u);
  EXPECT_GT(report.scans.longest_gap_s, 29.0);
  EXPECT_THAT(FormatLogReport(report), HasSubstr("faster than 5 m/s"));
}

TEST(LogCheck, UnreadableLinesAreNamed) {
  LogSummary summary;
  summary.complaint_count = 1;
  summary.complaints = {{17, "FLASER: 180 ranges promised, 20 found"}};
  const LogReport report = Check(GoodLog(), summary);
  EXPECT_TRUE(report.has_errors());
  EXPECT_THAT(FormatLogReport(report), HasSubstr("line 17: FLASER: 180 ranges promised, 20 found"));
}

}  // namespace
}  // namespace cairn::client
