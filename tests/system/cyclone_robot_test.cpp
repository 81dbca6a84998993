// The robot on Eclipse Cyclone DDS against cairnd: 200 scans of a real log there, poses and tiles back, both questions
// answered. The same robot against a stand-in, without a log: tests/integration/cyclone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>

#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/real_logs.h"

namespace cairn {
namespace {

using ::testing::HasSubstr;

TEST(CycloneRobot, StreamsARealLogToTheServerAndGetsItsPosesAndMap) {
  CAIRN_NEED_LOG(path, "mit-csail.clf");
  const std::string domain = std::to_string(test::TestDomain());
  ChildProcess server({CAIRND_PATH, "--domain", domain, "--set", "slam.particles=20"});
  setenv("CYCLONEDDS_URI", "file://" CAIRN_CYCLONE_CONFIG, 1);
  // It waits for the server itself.
  const auto robot =
      ChildProcess({CAIRN_CYCLONE_ROBOT, domain, path.string(), "csail", "cyclone-1", "200", "150"}).Wait();
  EXPECT_EQ(robot.exit_code, 0) << robot.output;
  EXPECT_THAT(robot.output, HasSubstr("\"ok\":true,\"scans_sent\":200,\"settled\":200"));
  std::printf("%s", robot.output.c_str());
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait().exit_code, 0);
}

}  // namespace
}  // namespace cairn
