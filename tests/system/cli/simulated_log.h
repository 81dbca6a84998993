// A log of a simulated robot (180 degrees, 181 beams), made once for the tests of a fixture that derives from this.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>
#include <string>

#include "client/cli/program.h"
#include "tests/temp_directory.h"

namespace cairn::client {

template <int kSeconds>
class SimulatedLog : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    logs_ = new TempDirectory;
    std::ostringstream out, err;
    const ExitCode code =
        RunCairn({"sim", "--no-stream", "--robots", "1", "--seconds", std::to_string(kSeconds), "--beams", "181",
                  "--fov", "180", "--first-stamp", "1000", "--log-dir", logs_->path().string()},
                 out, err);
    ASSERT_EQ(code, ExitCode::kOk) << err.str();
  }
  static void TearDownTestSuite() {
    delete logs_;
    logs_ = nullptr;
  }
  static std::filesystem::path LogFile() { return *logs_ / "robot1.log"; }

  static inline TempDirectory* logs_ = nullptr;
};

}  // namespace cairn::client
