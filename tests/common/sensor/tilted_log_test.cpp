// TILTLASER1: scans of a tilting scanner go into a log and come back, and other scans around them stay what they were.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "common/sensor/carmen_writer.h"
#include "common/sensor/log_reader.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

Scan SomeScan(double tilt, Stamp stamp) {
  Scan scan;
  scan.stamp = stamp;
  scan.angle_first_rad = -1.0;
  scan.angle_step_rad = 0.01;
  scan.range_max_m = 80.0;
  scan.tilt_rad = tilt;
  scan.T_robot_laser = {0.12, 0.0, 0.0};
  for (int i = 0; i < 201; ++i) scan.ranges_m.push_back(i % 7 == 0 ? INFINITY : 1.0F + static_cast<float>(i) * 0.01F);
  return scan;
}

std::vector<Scan> Read(const std::filesystem::path& path, LogSummary* summary = nullptr) {
  std::vector<Scan> scans;
  const auto read = ReadLog(path, {}, [&](LogRecord&& record) {
    if (auto* scan = std::get_if<Scan>(&record)) scans.push_back(std::move(*scan));
    return true;
  });
  EXPECT_TRUE(read) << read.error().message;
  if (read && summary != nullptr) *summary = *read;
  return scans;
}

TEST(TiltedLog, ScansComeBackWithTheirTilt) {
  const TempDirectory directory;
  std::ofstream file(directory / "tilt.log");
  CarmenWriter writer(file);
  std::vector<Scan> written;
  for (int i = 0; i < 6; ++i) {
    written.push_back(SomeScan(i < 2 ? 0.0 : 0.1 * i - 0.55, (i + 1) * kNanosPerSecond));
    writer.Write(written.back(), {0.1 * i, 0.2, 0.3});
  }
  file.close();
  LogSummary summary;
  const std::vector<Scan> scans = Read(directory / "tilt.log", &summary);
  EXPECT_EQ(summary.complaint_count, 0);
  ASSERT_EQ(scans.size(), 6u);
  for (std::size_t i = 0; i < scans.size(); ++i) {
    EXPECT_EQ(scans[i].tilt_rad, written[i].tilt_rad);
    EXPECT_EQ(scans[i].stamp, written[i].stamp);
    EXPECT_EQ(scans[i].angle_step_rad, written[i].angle_step_rad);
    EXPECT_EQ(scans[i].range_max_m, 80.0);
    EXPECT_NEAR(scans[i].T_robot_laser.x, 0.12, 1e-9);
    for (std::size_t k = 0; k < 201; ++k) {
      const BeamClass was = ClassifyRange(written[i].ranges_m[k], 0, 80),
                      is = ClassifyRange(scans[i].ranges_m[k], 0, 80);
      EXPECT_EQ(is, was);
      if (was == BeamClass::kHit) {
        EXPECT_EQ(scans[i].ranges_m[k], written[i].ranges_m[k]);
      }
    }
  }
}

// Other readers know messages by their name: a tilted scan must not pass for a level one.
TEST(TiltedLog, TiltedScansHaveANameOfTheirOwn) {
  std::ostringstream level, tilted;
  CarmenWriter(level).Write(SomeScan(0.0, 5), {});
  CarmenWriter(tilted).Write(SomeScan(0.2, 5), {});
  EXPECT_EQ(level.str().substr(0, 12), "ROBOTLASER1 ");
  EXPECT_EQ(tilted.str().substr(0, 15), "TILTLASER1 0.2 ");
}

// The scan of a nod may carry the stamp of the level one before it; it is no repetition of it.
TEST(TiltedLog, ATiltedScanIsNoTwinOfALevelOne) {
  const TempDirectory directory;
  std::ofstream file(directory / "tilt.log");
  CarmenWriter writer(file);
  writer.Write(SomeScan(0.0, kNanosPerSecond), {});
  writer.Write(SomeScan(0.2, kNanosPerSecond), {});
  file.close();
  EXPECT_EQ(Read(directory / "tilt.log").size(), 2u);
}

TEST(TiltedLog, BadTiltsAreComplaints) {
  const TempDirectory directory;
  std::ostringstream good;
  CarmenWriter(good).Write(SomeScan(0.2, kNanosPerSecond), {});
  std::string bad = good.str();
  bad.replace(11, 3, "nan");
  const auto path = directory.Write("bad.log", good.str() + bad + "TILTLASER1 0.1\n");
  LogSummary summary;
  EXPECT_EQ(Read(path, &summary).size(), 1u);
  EXPECT_EQ(summary.complaint_count, 2);
}

}  // namespace
}  // namespace cairn
