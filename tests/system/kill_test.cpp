// kill -9 under robots that drive: nothing that was sent is lost or used twice, and the robots' paths are those of a
// server that nobody killed. `cairn-study kills` does the same a thousand times.
#include <gtest/gtest.h>

#include <csignal>

#include "tests/child_process.h"
#include "tests/system/killed_fleet.h"
#include "tests/temp_directory.h"
#include "tests/test_domain.h"

namespace cairn::test {
namespace {

TEST(Kill, TwentyKillsChangeNothing) {
  const TempDirectory directory;
  KilledFleetOptions options;
  options.cairnd = CAIRND_PATH;
  options.cairn = CAIRN_PATH;
  options.directory = directory.path();
  options.robots = 2;
  options.seconds = 30.0;
  options.most_up_s = 0.8;
  options.kills = 20;
  const KilledFleetOutcome outcome = RunKilledFleet(options);
  SCOPED_TRACE(testing::PrintToString(outcome.differences));
  EXPECT_GE(outcome.kills, 10);  // A slow machine has no time for all.
  EXPECT_GT(outcome.sent, 500U);
  EXPECT_EQ(outcome.lost, 0U);
  EXPECT_EQ(outcome.doubled, 0U);
  EXPECT_EQ(outcome.wrongly_localized, 0U);
  EXPECT_EQ(outcome.beside_truth, 0U);  // The drive is too short for an error of this size.
  EXPECT_GT(outcome.undisturbed_poses, 0U);
  EXPECT_EQ(outcome.paths_that_differ, 0);
  EXPECT_GT(outcome.poses, 300U);
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
  // Poses go on.
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

TEST(Kill, ASecondServerOnTheSameStateEndsWithOneAndSaysSo) {
  const TempDirectory directory;
  ChildProcess first({CAIRND_PATH, "--domain", std::to_string(TestDomain()), "--state", directory.path().string()});
  ASSERT_TRUE(first.Says(" ready"));
  ChildProcess second(
      {CAIRND_PATH, "--domain", std::to_string(TestDomain() + 1), "--state", directory.path().string()});
  const auto outcome = second.Wait();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.output.find("another server uses the state directory"), std::string::npos) << outcome.output;
}

}  // namespace
}  // namespace cairn::test
