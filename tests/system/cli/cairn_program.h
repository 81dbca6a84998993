// `cairn` against cairnd as a process, over real DDS on loopback: the fixture of its tests.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/program.h"
#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/temp_directory.h"

namespace cairn::client {

struct Outcome {
  ExitCode code;
  std::string out;
  std::string err;

  [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(out); }
};

class CairnProgram : public ::testing::Test {
 protected:
  void StartServer() {
    server_.emplace(std::vector<std::string>{CAIRND_PATH, "--domain", std::to_string(test::TestDomain()), "--set",
                                             "slam.particles=20", "--log-level", "warn"});
    if (Cairn({"ping"}).code == ExitCode::kOk) return;
    server_->Signal(SIGKILL);
    FAIL() << "cairnd does not answer: " << server_->Wait().output;
  }

  // One command line, told the domain and to be patient with a busy machine.
  static Outcome Cairn(std::vector<std::string> arguments, const std::string& timeout = "20s") {
    arguments.insert(arguments.begin(), {"--domain", std::to_string(test::TestDomain()), "--timeout", timeout});
    std::ostringstream out, err;
    const ExitCode code = RunCairn(arguments, out, err);
    return {code, out.str(), err.str()};
  }
  static nlohmann::json MustJson(std::vector<std::string> arguments) {
    arguments.push_back("--json");
    const Outcome outcome = Cairn(std::move(arguments));
    EXPECT_EQ(outcome.code, ExitCode::kOk) << outcome.err;
    return outcome.out.empty() ? nlohmann::json() : outcome.json();
  }
  // Two robots, 10 s each, into site `hall`; the truth in truth/.
  nlohmann::json StreamFleet() {
    return MustJson({"sim", "--robots", "2", "--seconds", "10", "--fast", "--beams", "181", "--site", "hall",
                     "--first-stamp", "1000", "--truth-dir", File("truth")});
  }
  void WriteLog(const std::string& seconds) {
    MustJson({"sim", "--no-stream", "--robots", "1", "--seconds", seconds, "--beams", "181", "--fov", "180",
              "--first-stamp", "1000", "--log-dir", File("")});
  }
  [[nodiscard]] std::string File(const std::string& name) const { return (directory_ / name).string(); }

  TempDirectory directory_;
  std::optional<ChildProcess> server_;
};

}  // namespace cairn::client
