// kill -9 under robots that drive: nothing that was sent is lost or used twice, and the robots' paths are those of a
// server that nobody killed. `cairn-study kills` does the same a thousand times.
#include <gtest/gtest.h>

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
  options.seconds = 45.0;
  options.kills = 20;
  const KilledFleetOutcome outcome = RunKilledFleet(options);
  EXPECT_GE(outcome.kills, 15);
  EXPECT_GT(outcome.sent, 1000U);
  EXPECT_EQ(outcome.lost, 0U);
  EXPECT_EQ(outcome.doubled, 0U);
  EXPECT_EQ(outcome.wrongly_localized, 0U);
  EXPECT_EQ(outcome.paths_that_differ, 0);
  EXPECT_GT(outcome.poses, 500U);
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
