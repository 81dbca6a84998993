// The four published logs, read whole: counts, layouts and the ranges that mean nothing was hit.
#include "tests/real_logs.h"

#include <gtest/gtest.h>

#include "common/sensor/log_reader.h"

namespace cairn {
namespace {

struct Figures {
  LogSummary summary;
  std::int64_t no_returns = 0;
  int invalid_scans = 0;
  int unordered = 0;
  Scan last;
};

Figures Read(const std::filesystem::path& path) {
  Figures figures;
  Stamp last_scan = 0, last_odometry = 0;
  const auto summary = ReadLog(path, {}, [&](LogRecord&& record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      if (odometry->stamp <= last_odometry) ++figures.unordered;
      last_odometry = odometry->stamp;
      return true;
    }
    auto& scan = std::get<Scan>(record);
    if (scan.stamp <= last_scan) ++figures.unordered;
    last_scan = scan.stamp;
    if (!ValidateScan(scan)) ++figures.invalid_scans;
    for (const float range : scan.ranges_m) {
      if (ClassifyRange(range, scan.range_min_m, scan.range_max_m) == BeamClass::kNoReturn) ++figures.no_returns;
    }
    figures.last = std::move(scan);
    return true;
  });
  EXPECT_TRUE(summary) << summary.error().message;
  if (summary) figures.summary = *summary;
  EXPECT_EQ(figures.summary.complaint_count, 0);
  EXPECT_EQ(figures.invalid_scans, 0);
  EXPECT_EQ(figures.unordered, 0);
  return figures;
}

TEST(RealLogs, Intel) {
  CAIRN_NEED_LOG(path, "intel.clf");
  const Figures log = Read(path);
  EXPECT_EQ(log.summary.scans, 13'631);
  EXPECT_EQ(log.summary.odometries, 13'631);
  EXPECT_EQ(log.last.ranges_m.size(), 180u);
  EXPECT_DOUBLE_EQ(log.last.angle_step_rad, kPi / 180);
  EXPECT_EQ(log.last.range_max_m, 80.0);
  EXPECT_EQ(log.last.T_robot_laser, Pose2{});
  EXPECT_EQ(log.no_returns, 68'313);  // Readings of 81.83 m.
}

TEST(RealLogs, MitCsail) {
  CAIRN_NEED_LOG(path, "mit-csail.clf");
  const Figures log = Read(path);
  EXPECT_EQ(log.summary.scans, 1'988);
  EXPECT_EQ(log.summary.odometries, 1'988 + 4'188);
  EXPECT_EQ(log.last.ranges_m.size(), 361u);
  EXPECT_DOUBLE_EQ(log.last.angle_step_rad, kPi / 360);
  EXPECT_EQ(log.last.range_max_m, 80.0);
  EXPECT_EQ(log.last.T_robot_laser, Pose2{});
  EXPECT_EQ(log.no_returns, 23'711);  // Readings of 81.91 m.
}

TEST(RealLogs, MitKillian) {
  CAIRN_NEED_LOG(path, "mit-killian.clf");
  const Figures log = Read(path);
  EXPECT_EQ(log.summary.scans, 17'480);
  EXPECT_EQ(log.summary.odometries, 17'480);
  EXPECT_DOUBLE_EQ(log.last.angle_step_rad, kPi / 180);
  EXPECT_GT(log.last.range_max_m, 50.96);
  EXPECT_LE(log.last.range_max_m, 51.0);
  EXPECT_EQ(log.no_returns, 39'757);  // Readings of 51.0 m and above.
}

TEST(RealLogs, DukeLoop) {
  CAIRN_NEED_LOG(path, "duke-loop5.log");
  const Figures log = Read(path);
  EXPECT_EQ(log.summary.scans, 551);
  EXPECT_EQ(log.summary.odometries, 551);
  EXPECT_EQ(log.last.ranges_m.size(), 181u);
  EXPECT_DOUBLE_EQ(log.last.angle_step_rad, kPi / 180);
  EXPECT_EQ(log.last.T_robot_laser, (Pose2{0.4, 0, 0}));
  EXPECT_NEAR(log.last.range_max_m, 8.17, 0.02);  // 8.183 m piles up, and 8.187, 8.191 above it.
}

}  // namespace
}  // namespace cairn
