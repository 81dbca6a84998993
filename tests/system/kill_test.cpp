// kill -9 under robots that drive: nothing that was sent is lost or used twice, and the robots' paths are those of a
// server that nobody killed. `cairn-study kills` does the same a thousand times.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "server/store/store.h"
#include "tests/child_process.h"
#include "tests/own_mount.h"
#include "tests/server/support/raw_records.h"
#include "tests/system/killed_fleet.h"
#include "tests/temp_directory.h"
#include "tests/test_domain.h"

namespace cairn::test {
namespace {

KilledFleetOptions FleetIn(const TempDirectory& directory) {
  KilledFleetOptions options;
  options.cairnd = CAIRND_PATH;
  options.cairn = CAIRN_PATH;
  options.directory = directory.path();
  return options;
}

TEST(Kill, TwentyKillsChangeNothing) {
  constexpr int kKills = 20;
  int kills = 0;
  std::uint64_t poses = 0;
  // One round, where the machine is fast enough.
  for (std::uint64_t round = 1; kills < kKills; ++round) {
    const TempDirectory directory;
    KilledFleetOptions options = FleetIn(directory);
    options.robots = 4;
    options.seconds = 15.0;
    options.most_up_s = 0.6;
    options.kills = kKills - kills;
    options.seed = round;
    options.ends = true;
    const KilledFleetOutcome outcome = RunKilledFleet(options);
    SCOPED_TRACE(testing::PrintToString(outcome.differences));
    ASSERT_GT(outcome.kills, 0);
    EXPECT_GT(outcome.sent, 500U);
    EXPECT_EQ(outcome.lost, 0U);
    EXPECT_EQ(outcome.doubled, 0U);
    EXPECT_EQ(outcome.wrongly_localized, 0U) << testing::PrintToString(outcome.wrong);
    EXPECT_EQ(outcome.beside_truth, 0U);  // The drive is too short for an error of this size.
    EXPECT_GT(outcome.undisturbed_poses, 0U);
    EXPECT_EQ(outcome.paths_that_differ, 0);
    kills += outcome.kills;
    poses += outcome.poses;
  }
  EXPECT_EQ(kills, kKills);
  EXPECT_GT(poses, 300U);
}

// A limited disk: the server removes what no checkpoint needs, also while it is killed again and again.
TEST(Kill, WhileOldHistoryIsRemovedChangesNothing) {
  const TempDirectory directory;
  KilledFleetOptions options = FleetIn(directory);
  options.robots = 4;
  options.seconds = 20.0;
  options.most_up_s = 1.0;
  options.kills = 10;
  options.settings = {"store.max_gib=0.001"};
  const KilledFleetOutcome outcome = RunKilledFleet(options);
  EXPECT_GE(outcome.kills, 3);
  EXPECT_EQ(outcome.lost, 0U) << testing::PrintToString(outcome.differences);
  EXPECT_EQ(outcome.doubled, 0U) << testing::PrintToString(outcome.differences);
  EXPECT_EQ(outcome.wrongly_localized, 0U) << testing::PrintToString(outcome.wrong);
  EXPECT_EQ(outcome.paths_that_differ, 0) << testing::PrintToString(outcome.differences);
  // The first seconds of all robots are gone, and everything since their checkpoints is there.
  cairn::server::testing::RawRecords records(directory / "killed");
  const std::string journal = "kind = " + std::to_string(static_cast<int>(cairn::server::RecordKind::kJournal));
  EXPECT_TRUE(records.Of(journal + " AND number <= " + cairn::server::testing::Sql(100)).empty());
  EXPECT_FALSE(records.Of(journal).empty());
}

// Whoever was told that the map is switched, or that a job is there, finds it so after each start.
TEST(Kill, OrdersThatWereAnsweredHold) {
  const TempDirectory directory;
  KilledFleetOptions options = FleetIn(directory);
  options.seconds = 20.0;
  options.most_up_s = 2.0;
  options.kills = 10;
  options.orders = true;
  const KilledFleetOutcome outcome = RunKilledFleet(options);
  EXPECT_GE(outcome.kills, 3);
  EXPECT_EQ(outcome.lost, 0U) << testing::PrintToString(outcome.differences);
  EXPECT_EQ(outcome.doubled, 0U) << testing::PrintToString(outcome.differences);
  EXPECT_EQ(outcome.wrongly_localized, 0U) << testing::PrintToString(outcome.wrong);
  EXPECT_GT(outcome.orders.jobs, 0);
  EXPECT_EQ(outcome.orders.ended, outcome.orders.jobs);
  // Jobs run one after the other, and one is given up when eight servers have died during it.
  EXPECT_LE(outcome.orders.given_up, outcome.kills / 8);
  EXPECT_GT(outcome.orders.switches, 0);
  EXPECT_GT(outcome.orders.checks, 3);
  EXPECT_EQ(outcome.orders.broken, std::vector<std::string>{});
}

// The disk is full for this process: no file of its may grow beyond a limit (setrlimit(2), RLIMIT_FSIZE).
TEST(Kill, WithoutSpaceOnTheDiskItIsDegradedSaysSoAndEndsWithThree) {
  const TempDirectory directory;
  const std::string domain = std::to_string(TestDomain());
  const std::string command = "trap '' XFSZ; ulimit -f 300; exec '" + std::string(CAIRND_PATH) + "' --domain " +
                              domain + " --set slam.particles=20 --state '" + (directory / "state").string() + "'";
  ChildProcess server({"/bin/bash", "-c", command});
  ASSERT_TRUE(server.Says(" ready"));
  ChildProcess robots({CAIRN_PATH, "sim", "--site", "office", "--world", "office", "--robots", "1", "--beams", "181",
                       "--hz", "20", "--seconds", "60", "--domain", domain, "--json"});
  ASSERT_TRUE(server.Says("degraded, new data is not stored"));
  const auto status = ChildProcess({CAIRN_PATH, "status", "--domain", domain, "--json"}).Wait();
  EXPECT_EQ(status.exit_code, 0);
  EXPECT_NE(status.output.find("\"degraded\":\"cannot write to the store"), std::string::npos) << status.output;
  const auto poses =
      ChildProcess({CAIRN_PATH, "pose", "robot1", "--follow", "--count", "5", "--domain", domain, "--json"}).Wait();
  EXPECT_EQ(poses.exit_code, 0) << poses.output;
  EXPECT_TRUE(robots.RunningAfter(std::chrono::milliseconds(0)));
  server.Signal(SIGTERM);
  const auto outcome = server.Wait();
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_NE(outcome.output.find("stopped while degraded"), std::string::npos) << outcome.output;
  // With space again, what was durable before is there.
  ChildProcess next(
      {CAIRND_PATH, "--domain", domain, "--set", "slam.particles=20", "--state", (directory / "state").string()});
  ASSERT_TRUE(next.Says(" ready"));
  const auto after = ChildProcess({CAIRN_PATH, "status", "--domain", domain, "--json"}).Wait();
  EXPECT_NE(after.output.find("\"degraded\":\"\""), std::string::npos) << after.output;
  EXPECT_NE(after.output.find("\"robots\":[{"), std::string::npos) << after.output;
}

// A record of the state is damaged: everything else is served, and whoever stops the server hears of it.
TEST(Kill, WithADamagedRecordItServesTheRestAndEndsWithThree) {
  const char* const source = std::getenv("CAIRN_SOURCE_DIR");
  ASSERT_NE(source, nullptr);
  const TempDirectory directory;
  std::filesystem::copy_file(std::filesystem::path(source) / "tests" / "golden" / "state-1" / "cairn.db",
                             directory / "cairn.db");
  ASSERT_GE(cairn::server::testing::RawRecords(directory.path())
                .Run("UPDATE records SET content = CAST(x'00ff00' || substr(content, 4) AS BLOB) WHERE kind = " +
                     std::to_string(static_cast<int>(cairn::server::RecordKind::kSession)) +
                     " AND owner = (SELECT MIN(owner) FROM records WHERE kind = 1)"),
            1);
  const std::string domain = std::to_string(TestDomain());
  ChildProcess server({CAIRND_PATH, "--domain", domain, "--state", directory.path().string()});
  ASSERT_TRUE(server.Says(" ready"));
  const auto status = ChildProcess({CAIRN_PATH, "status", "--domain", domain, "--json"}).Wait();
  EXPECT_NE(status.output.find("set aside"), std::string::npos) << status.output;
  EXPECT_NE(status.output.find("\"robot2\""), std::string::npos) << status.output;
  server.Signal(SIGTERM);
  const auto outcome = server.Wait();
  EXPECT_EQ(outcome.exit_code, 3) << outcome.output;
  EXPECT_NE(outcome.output.find("some of the old could not be read"), std::string::npos) << outcome.output;
}

// A server that leaves its state behind.
void StartAndStop(const std::vector<std::string>& command) {
  ChildProcess first(command);
  ASSERT_TRUE(first.Says(" ready"));
  first.Signal(SIGTERM);
  EXPECT_EQ(first.Wait().exit_code, 0);
}

// Nobody can write there, not even root. Nothing that an earlier server stored may be lost by the attempt.
TEST(Kill, AServerOnAReadOnlyStateDoesNotStartAndSaysWhy) {
  const TempDirectory directory;
  const std::vector<std::string> command = {CAIRND_PATH, "--domain", std::to_string(TestDomain()), "--state",
                                            directory.path().string()};
  ASSERT_NO_FATAL_FAILURE(StartAndStop(command));
  {
    const auto mount = OwnMount::ReadOnly(directory.path());
    if (!mount) GTEST_SKIP() << "SKIPPED: this user may not mount a directory read-only";
    const auto outcome = ChildProcess(command).Wait();
    EXPECT_EQ(outcome.exit_code, 1) << outcome.output;
    EXPECT_NE(outcome.output.find("cannot start: cannot open '"), std::string::npos) << outcome.output;
    EXPECT_NE(outcome.output.find("Read-only file system"), std::string::npos) << outcome.output;
  }
  ChildProcess next(command);
  EXPECT_TRUE(next.Says(" ready"));
}

// A page of the database, and its first one, hold something else: nothing is guessed, and nothing is written over.
TEST(Kill, AServerOnADamagedDatabaseEndsWithTwoAndSaysWhy) {
  const TempDirectory directory;
  const std::vector<std::string> command = {CAIRND_PATH, "--domain", std::to_string(TestDomain()), "--state",
                                            directory.path().string()};
  ASSERT_NO_FATAL_FAILURE(StartAndStop(command));
  const auto database = directory.path() / "cairn.db";
  const auto size = std::filesystem::file_size(database);
  for (const std::uintmax_t page : {std::uintmax_t{1}, std::uintmax_t{0}}) {
    ASSERT_GT(size, (page + 1) * 4096);
    {
      std::fstream file(database, std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(page * 4096));
      file << std::string(4096, '\x5a');
    }
    const auto outcome = ChildProcess(command).Wait();
    EXPECT_EQ(outcome.exit_code, 2) << page << outcome.output;
    EXPECT_NE(outcome.output.find("cannot start: "), std::string::npos) << outcome.output;
    const bool says_why = outcome.output.find("database disk image is malformed") != std::string::npos ||
                          outcome.output.find("file is not a database") != std::string::npos;
    EXPECT_TRUE(says_why) << outcome.output;
    EXPECT_EQ(std::filesystem::file_size(database), size);
  }
}

// Any page of the database holds something else. Robots and maps of which it held nothing are as they were; of the
// others the status says that they are set aside, and so does the exit code. Nothing is shorter than it was without a
// word.
TEST(Kill, WithAnyDamagedPageItServesTheRestAndSaysWhatIsMissing) {
  constexpr std::uintmax_t kPage = 4096, kStep = 12;
  const char* const source = std::getenv("CAIRN_SOURCE_DIR");
  ASSERT_NE(source, nullptr);
  const auto golden = std::filesystem::path(source) / "tests" / "golden" / "state-1" / "cairn.db";
  const std::string domain = std::to_string(TestDomain());
  int whole = 0, set_aside = 0;
  for (std::uintmax_t at = 3 * kPage; at < std::filesystem::file_size(golden); at += kStep * kPage) {
    SCOPED_TRACE("page " + std::to_string(at / kPage));
    const TempDirectory directory;
    std::filesystem::copy_file(golden, directory / "cairn.db");
    {
      std::fstream file(directory / "cairn.db", std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(at));
      file << std::string(kPage, '\x5a');
    }
    ChildProcess server({CAIRND_PATH, "--domain", domain, "--state", directory.path().string()});
    if (!server.Says(" ready")) {
      const auto outcome = server.Wait();
      EXPECT_EQ(outcome.exit_code, 2) << outcome.output;
      EXPECT_NE(outcome.output.find("database disk image is malformed"), std::string::npos) << outcome.output;
      continue;
    }
    const auto asked = ChildProcess({CAIRN_PATH, "status", "--domain", domain, "--timeout", "20s", "--json"}).Wait();
    ASSERT_EQ(asked.exit_code, 0) << asked.output;
    const std::string& status = asked.output;
    server.Signal(SIGTERM);
    const int exit_code = server.Wait().exit_code;
    if (status.find("set aside") != std::string::npos) {
      EXPECT_EQ(exit_code, 3);
      ++set_aside;
      continue;
    }
    EXPECT_EQ(exit_code, 0);
    const auto first = status.find("\"used\":32");
    ASSERT_NE(first, std::string::npos) << status;
    EXPECT_NE(status.find("\"used\":32", first + 1), std::string::npos) << status;
    ++whole;
  }
  EXPECT_GT(whole, 0);
  EXPECT_GT(set_aside, 0);
}

// With another filter, every scan is processed again before the server is ready, which takes long with so many
// particles. Somebody who stops the server meanwhile does not wait for that.
TEST(Kill, ALongStartEndsInGoodOrderWhenItIsAskedToAndNothingIsLost) {
  const TempDirectory directory;
  const std::vector<std::string> command = {CAIRND_PATH,         "--domain", std::to_string(TestDomain()),  "--set",
                                            "slam.particles=20", "--state",  (directory / "state").string()};
  {
    ChildProcess first(command);
    ASSERT_TRUE(first.Says(" ready"));
    const auto drive = ChildProcess({CAIRN_PATH, "sim", "--site", "office", "--world", "office", "--robots", "1",
                                     "--beams", "361", "--seconds", "30", "--fast", "--domain", command[2]})
                           .Wait();
    EXPECT_EQ(drive.exit_code, 0) << drive.output;
    first.Signal(SIGTERM);
    EXPECT_EQ(first.Wait().exit_code, 0);
  }
  std::vector<std::string> longer = command;
  longer.insert(longer.end(), {"--set", "slam.filter=dpslam", "--set", "slam.particles=10000"});
  ChildProcess second(longer);
  ASSERT_TRUE(second.Says("restoring 1 sessions"));
  second.Signal(SIGTERM);
  const auto outcome = second.Wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_NE(outcome.output.find("the start is given up"), std::string::npos) << outcome.output;
  EXPECT_NE(outcome.output.find("stopped before the start was finished"), std::string::npos) << outcome.output;
  EXPECT_EQ(outcome.output.find(" ready"), std::string::npos) << outcome.output;
  ChildProcess third(command);
  ASSERT_TRUE(third.Says(" ready"));
  const auto after = ChildProcess({CAIRN_PATH, "status", "--domain", command[2], "--json"}).Wait();
  EXPECT_NE(after.output.find("\"used\":300"), std::string::npos) << after.output;
}

TEST(Kill, ASecondServerOnTheSameStateEndsWithOneAndSaysSo) {
  const TempDirectory directory;
  ChildProcess first({CAIRND_PATH, "--domain", std::to_string(TestDomain()), "--state", directory.path().string()});
  ASSERT_TRUE(first.Says(" ready"));
  ChildProcess second(
      {CAIRND_PATH, "--domain", std::to_string(AnotherTestDomain()), "--state", directory.path().string()});
  const auto outcome = second.Wait();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.output.find("another server uses the state directory"), std::string::npos) << outcome.output;
}

}  // namespace
}  // namespace cairn::test
