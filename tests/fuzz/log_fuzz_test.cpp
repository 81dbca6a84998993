#include <gtest/gtest.h>

#include "common/sensor/log_reader.h"
#include "tests/fuzz/mutation.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

constexpr std::string_view kCarmen =
    "# comment\nPARAM laser_type SICK 1.0 host 0.1\nODOM 1.5 -2.25 0.5 0.1 0.0 0 976052857.100000 host 0.1\n"
    "FLASER 5 1.07 1.08 81.83 2.5 3 1.7 -2.25 0.5 1.5 -2.25 0.5 976052857.337530 host 0.3\n"
    "RLASER 3 1 2 3 1.3 -2.25 3.6 1.5 -2.25 0.5 976052857.437530 host 0.4\n"
    "ROBOTLASER1 0 -1.57 3.14 0.78 30 0.01 0 5 1 2 3 4 5 2 7 8 1 1 0 1 1 0 0.3 0.1 0 0 0 976052858.0 host 1\n"
    "RAWLASER1 0 -1.5 3.0 1.5 81.9 0.01 0 3 1 2 3 0 976052859.5 host 1\n";
constexpr std::string_view kDpslam = "Odometry 1 2 0.5 \nLaser 4 1 2 3 8.19 \nOdometry 1.1 2 0.5 \nLaser 4 1 2 3 4 \n";

const std::vector<std::string_view> kWords = {"nan",        "inf",        "-inf",
                                              "-1",         "0",          "1e308",
                                              "1e-320",     "4294967296", "9223372036854775808",
                                              "100001",     "100000",     "FLASER ",
                                              "\n",         "\r\n",       std::string_view("\0", 1),
                                              "ODOM ",      "Laser ",     "Odometry ",
                                              "RAWLASER1 ", " ",          "\t",
                                              "-0",         ".",          "e"};

// Every record that comes out of a damaged log is a value: counts add up, stamps and poses are finite numbers.
void ReadDamaged(std::string_view good, std::uint64_t seed, int rounds) {
  const TempDirectory directory;
  std::mt19937_64 random(seed);
  int read = 0, refused = 0;
  for (int i = 0; i < rounds; ++i) {
    const auto path = directory.Write("log", Mutate(std::string(good), random, kWords));
    int scans = 0, odometries = 0;
    const auto summary = ReadLog(path, {}, [&](LogRecord&& record) {
      if (const auto* odometry = std::get_if<Odometry>(&record)) {
        ++odometries;
        EXPECT_TRUE(odometry->T_odom_robot.IsFinite());
        EXPECT_LE(std::abs(odometry->T_odom_robot.theta), kPi);
      } else {
        ++scans;
        const Scan& scan = std::get<Scan>(record);
        EXPECT_GE(scan.ranges_m.size(), 1u);
        EXPECT_TRUE(scan.T_robot_laser.IsFinite());
        static_cast<void>(ValidateScan(scan));  // Any answer, but no undefined behaviour.
      }
      return true;
    });
    if (!summary) {
      EXPECT_FALSE(summary.error().message.empty());
      ++refused;
      continue;
    }
    ++read;
    EXPECT_EQ(summary->scans, scans);
    EXPECT_EQ(summary->odometries, odometries);
    EXPECT_GE(static_cast<std::size_t>(summary->complaint_count), summary->complaints.size());
    for (const LogComplaint& complaint : summary->complaints) {
      EXPECT_GT(complaint.line, 0);
      EXPECT_FALSE(complaint.reason.empty());
    }
  }
  EXPECT_GT(read, rounds / 4) << "the damage is too heavy to test anything: " << refused << " refused";
}

TEST(LogFuzz, DamagedCarmenLogs) {
  ReadDamaged(kCarmen, 1, 4000);
}

TEST(LogFuzz, DamagedDpslamLogs) {
  ReadDamaged(kDpslam, 2, 4000);
}

TEST(LogFuzz, EveryTruncationOfALog) {
  const TempDirectory directory;
  for (std::size_t length = 0; length <= kCarmen.size(); ++length) {
    const auto path = directory.Write("log", std::string(kCarmen.substr(0, length)));
    const auto summary = ReadLog(path, {}, [](LogRecord&&) { return true; });
    EXPECT_LE(summary ? summary->complaint_count : 0, 1) << length;  // Only the cut line.
  }
}

}  // namespace
}  // namespace cairn
