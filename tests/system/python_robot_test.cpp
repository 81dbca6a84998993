// The example in Python (client/python) against cairnd, as its README starts it: build.sh makes its messages of the
// IDL, and the robot drives along a simulated corridor and gets its poses back.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>

#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

TEST(PythonRobot, IsLocalizedInTheCorridorThatItMaps) {
  const TempDirectory built;
  const std::string example = CAIRN_PYTHON_EXAMPLE;
  const auto build = ChildProcess({"/bin/sh", example + "/build.sh", built.path().string()}).Wait();
  ASSERT_EQ(build.exit_code, 0) << build.output;

  const std::string domain = std::to_string(test::TestDomain());
  ChildProcess server({CAIRND_PATH, "--domain", domain, "--set", "slam.particles=20"});
  setenv("PYTHONDONTWRITEBYTECODE", "1", 1);
  unsetenv("CYCLONEDDS_URI");  // It chooses the loopback itself.
  const auto robot =
      ChildProcess({CAIRN_PYTHON, example + "/robot.py", "--domain", domain, "--built", built.path().string()}).Wait();
  ASSERT_EQ(robot.exit_code, 0) << robot.output;
  const std::size_t last = robot.output.rfind("220 scans, ");
  ASSERT_NE(last, std::string::npos) << robot.output;
  const std::string summary = robot.output.substr(last);
  int poses = 0, localized = 0;
  double worst_m = 1e9;
  ASSERT_EQ(std::sscanf(summary.c_str(), "220 scans, %d poses, %d of them localized, at most %lf m", &poses, &localized,
                        &worst_m),
            3)
      << summary;
  std::printf("%s", summary.c_str());
  // A pose that another one follows at once may be left out, because the topic keeps the newest only.
  EXPECT_GE(localized, 20) << robot.output;
  EXPECT_EQ(localized, poses) << robot.output;
  EXPECT_LT(worst_m, 0.15);
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait().exit_code, 0);
}

}  // namespace
}  // namespace cairn
