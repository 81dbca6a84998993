#include "client/lib/backlog.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>

#include "tests/own_mount.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using ::testing::ElementsAre;

constexpr NameId kLaser = 11;
constexpr NameId kOdometry = 22;
constexpr std::size_t kPlenty = 1 << 20;

StreamedSample ScanOf(std::uint64_t sequence, std::size_t beams = 100) {
  Scan scan;
  scan.sequence = sequence;
  scan.stamp = static_cast<Stamp>(sequence) * 100;
  scan.tilt_rad = 0.25;
  scan.T_robot_laser = {1, 2, 3};
  scan.ranges_m.assign(beams, static_cast<float>(sequence));
  return ScanSample{{1, kLaser, 5}, scan};
}

StreamedSample OdometryOf(std::uint64_t sequence, Stamp stamp, double x = 0.0) {
  return OdometrySample{{1, kOdometry, 5}, {.sequence = sequence, .stamp = stamp, .T_odom_robot = {x, 0, 0}}};
}

// What comes from the cursor on: the number of a scan, minus the number of odometry.
std::vector<int> Rest(Backlog& backlog) {
  std::vector<int> rest;
  while (const auto sample = backlog.Next()) {
    const auto* const scan = std::get_if<ScanSample>(sample.get());
    rest.push_back(scan != nullptr ? static_cast<int>(scan->scan.sequence)
                                   : -static_cast<int>(std::get<OdometrySample>(*sample).odometry.sequence));
  }
  return rest;
}

TEST(Backlog, GivesEachSampleOnceInItsOrderAndAllAgainAfterRewind) {
  Backlog backlog(kPlenty);
  backlog.Add(OdometryOf(1, 50));
  backlog.Add(ScanOf(1));
  backlog.Add(OdometryOf(2, 150));
  EXPECT_EQ(backlog.unsent(), 3U);
  EXPECT_THAT(Rest(backlog), ElementsAre(-1, 1, -2));
  EXPECT_EQ(backlog.unsent(), 0U);
  backlog.StepBack();
  EXPECT_THAT(Rest(backlog), ElementsAre(-2));
  backlog.Rewind();
  EXPECT_THAT(Rest(backlog), ElementsAre(-1, 1, -2));
}

TEST(Backlog, KeepsWhatIsNotSafeAndWhatComesAfterIt) {
  Backlog backlog(kPlenty);
  for (std::uint64_t i = 1; i <= 4; ++i) {
    backlog.Add(OdometryOf(i, static_cast<Stamp>(i) * 100 - 50));
    backlog.Add(ScanOf(i));
  }
  static_cast<void>(Rest(backlog));
  backlog.Safe(kLaser, 2);
  EXPECT_EQ(backlog.size(), 8U);  // The odometry before them is not safe.
  backlog.Safe(kOdometry, 4);
  backlog.Rewind();
  EXPECT_THAT(Rest(backlog), ElementsAre(3, -4, 4));
}

TEST(Backlog, WhatWasNotSentCannotBeSafe) {
  Backlog backlog(kPlenty);
  backlog.Add(ScanOf(1));
  backlog.Safe(kLaser, 5);
  EXPECT_EQ(backlog.size(), 1U);
}

TEST(Backlog, GivesUpTheOldestBeyondItsBoundAndSaysSo) {
  Backlog backlog(20 * 1024);
  for (std::uint64_t i = 1; i <= 100; ++i) backlog.Add(ScanOf(i));
  EXPECT_LE(backlog.bytes(), 20U * 1024);
  EXPECT_GT(backlog.size(), 10U);
  EXPECT_EQ(backlog.displaced(), 100 - backlog.size());
  EXPECT_EQ(Rest(backlog).back(), 100);
}

TEST(Backlog, ASpillFileTakesWhatIsBeyondTheBoundWithoutAChange) {
  const TempDirectory directory;
  Backlog backlog(20 * 1024);
  auto file = *SpillFile::Create((directory / "spill").string());
  const SpillFile& spill = *file;
  backlog.SpillTo(std::move(file));
  backlog.Add(OdometryOf(1, 50, 7.5));
  for (std::uint64_t i = 1; i <= 100; ++i) backlog.Add(ScanOf(i));
  EXPECT_LE(backlog.bytes(), 20U * 1024);
  EXPECT_EQ(backlog.displaced(), 0U);
  EXPECT_EQ(backlog.spill_error(), "");
  const auto odometry = backlog.Next();
  EXPECT_EQ(std::get<OdometrySample>(*odometry).odometry.T_odom_robot.x, 7.5);
  const auto first = backlog.Next();
  const Scan& scan = std::get<ScanSample>(*first).scan;
  EXPECT_EQ(scan.sequence, 1U);
  EXPECT_EQ(scan.stamp, 100);
  EXPECT_EQ(scan.tilt_rad, 0.25);
  EXPECT_EQ(scan.T_robot_laser, (Pose2{1, 2, 3}));
  EXPECT_EQ(scan.ranges_m, std::vector<float>(100, 1.0F));
  EXPECT_EQ(Rest(backlog).size(), 99U);
  // Renumbered in a new session, also on disk.
  backlog.Safe(kOdometry, 1);
  backlog.Safe(kLaser, 40);
  const auto highest = backlog.MoveTo(6);
  EXPECT_EQ(highest.at(kLaser), 60U);
  EXPECT_EQ(highest.at(kOdometry), 1U);
  static_cast<void>(backlog.Next());
  const auto renumbered = backlog.Next();
  EXPECT_EQ(std::get<ScanSample>(*renumbered).scan.sequence, 1U);
  EXPECT_EQ(std::get<ScanSample>(*renumbered).stream.session, 6U);
  EXPECT_EQ(std::get<ScanSample>(*renumbered).scan.ranges_m[0], 41.0F);
  EXPECT_GT(spill.size(), 0U);
  static_cast<void>(Rest(backlog));
  backlog.Safe(kOdometry, 1);
  backlog.Safe(kLaser, 59);
  EXPECT_EQ(spill.size(), 0U);
}

// A process that was killed could not remove its file, and could not be started again with the same command.
TEST(Backlog, AKilledProcessLeavesNoSpillFile) {
  const TempDirectory directory;
  const std::string path = (directory / "spill").string();
  const auto of_one = SpillFile::Create(path), of_another = SpillFile::Create(path);
  ASSERT_TRUE(of_one && of_another);
  EXPECT_FALSE(std::filesystem::exists(path));
  ASSERT_TRUE((*of_one)->Append("one") && (*of_another)->Append("another"));
  EXPECT_EQ(*(*of_one)->Read(0), "one");
  EXPECT_EQ(*(*of_another)->Read(0), "another");
}

TEST(Backlog, KnowsTheOldestOfEachStream) {
  Backlog backlog(20 * 1024);
  EXPECT_EQ(backlog.OldestOf(kLaser), std::nullopt);
  backlog.Add(OdometryOf(1, 50, 0.0));
  for (std::uint64_t i = 1; i <= 100; ++i) backlog.Add(ScanOf(i));
  EXPECT_EQ(backlog.OldestOf(kLaser), backlog.displaced());  // The odometry is one of those.
}

TEST(Backlog, NobodysFileIsOverwritten) {
  EXPECT_EQ(SpillFile::Create("/dev/full").error().code, StatusCode::kAlreadyExists);
  EXPECT_EQ(SpillFile::Create("/nowhere/at/all").error().code, StatusCode::kUnavailable);
}

// The scans that are left are the newest ones, as they were given.
void ExpectTheNewest(Backlog& backlog, std::uint64_t added) {
  EXPECT_EQ(backlog.displaced() + backlog.size(), added);
  backlog.Rewind();
  std::uint64_t next = backlog.displaced();
  while (const auto sample = backlog.Next()) {
    const Scan& scan = std::get<ScanSample>(*sample).scan;
    ASSERT_EQ(scan.sequence, ++next);
    ASSERT_EQ(scan.ranges_m, std::vector<float>(100, static_cast<float>(next)));
  }
  EXPECT_EQ(next, added);
}

// No file of this process may grow beyond a limit (setrlimit(2), RLIMIT_FSIZE).
TEST(Backlog, WhatNoFileTakesIsGivenUpAndSaid) {
  const TempDirectory directory;
  Backlog backlog(20 * 1024);
  backlog.SpillTo(std::move(*SpillFile::Create((directory / "spill").string())));
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small{100, before.rlim_max};
  std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  for (std::uint64_t i = 1; i <= 100; ++i) backlog.Add(ScanOf(i));
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_LE(backlog.bytes(), 20U * 1024);
  EXPECT_GT(backlog.displaced(), 50U);
  EXPECT_NE(backlog.spill_error().find("spill: cannot be written: File too large"), std::string::npos)
      << backlog.spill_error();
  ExpectTheNewest(backlog, 100);
}

// All that was in the file was given up where one more scan did not fit, and the file was never used again.
TEST(Backlog, OnAFullDiskTheOldestMakeRoomForTheNewest) {
  const TempDirectory directory;
  const auto disk = test::OwnMount::Disk(directory.path(), 64 * 1024);
  if (!disk) GTEST_SKIP() << "SKIPPED: this user may not mount a small disk";
  Backlog backlog(20 * 1024);
  backlog.SpillTo(std::move(*SpillFile::Create((directory / "spill").string())));
  std::uint64_t added = 0;
  while (backlog.displaced() == 0 && added < 1000) backlog.Add(ScanOf(++added));
  const std::size_t most = backlog.size();
  EXPECT_GT(most, 100U);
  EXPECT_NE(backlog.spill_error().find("spill: cannot be written: No space left on device"), std::string::npos)
      << backlog.spill_error();
  for (int i = 0; i < 200; ++i) {
    backlog.Add(ScanOf(++added));
    ASSERT_GE(backlog.size(), most - 20) << "the oldest make room, a page of the disk at a time";
    ASSERT_LE(backlog.bytes(), 20U * 1024);
  }
  ExpectTheNewest(backlog, added);
}

TEST(Backlog, ANewSessionBeginsWithTheOdometryBeforeItsFirstScan) {
  Backlog backlog(kPlenty);
  for (std::uint64_t i = 1; i <= 3; ++i) {
    backlog.Add(OdometryOf(i, static_cast<Stamp>(i) * 100 - 50, static_cast<double>(i)));
    backlog.Add(ScanOf(i));
  }
  backlog.Add(OdometryOf(4, 350, 4.0));
  static_cast<void>(Rest(backlog));
  backlog.Safe(kOdometry, 4);
  backlog.Safe(kLaser, 2);
  const auto there = backlog.OdometryAtFirstScan();
  ASSERT_TRUE(there);
  EXPECT_TRUE(there->complete);
  EXPECT_DOUBLE_EQ(there->T_odom_robot.x, 3.5);  // The third scan lies in the middle of odometry 3 and 4.
  const auto highest = backlog.MoveTo(6);
  EXPECT_EQ(highest.at(kLaser), 1U);
  EXPECT_EQ(highest.at(kOdometry), 2U);
  EXPECT_THAT(Rest(backlog), ElementsAre(-1, 1, -2));
}

}  // namespace
}  // namespace cairn::client
