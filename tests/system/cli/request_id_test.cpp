// The id of a request leads from the client's error to the server's log.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <sstream>
#include <string>
#include <vector>

#include "tests/system/cli/cairn_program.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

TEST_F(CairnProgram, TheRequestThatAnErrorNamesIsInTheServersLog) {
  const Outcome alone = Cairn({"ping", "--json"}, "300ms");
  ASSERT_EQ(alone.code, ExitCode::kFailed);
  EXPECT_FALSE(alone.json()["error"].contains("request")) << "none was sent: " << alone.out;

  server_.emplace(
      std::vector<std::string>{CAIRND_PATH, "--domain", std::to_string(test::TestDomain()), "--log-format", "json"});
  ASSERT_TRUE(server_->Says("\"message\":\"ready\""));
  const Outcome refused = Cairn({"job", "cancel", "999", "--json"});
  ASSERT_EQ(refused.code, ExitCode::kFailed);
  const auto error = refused.json()["error"];
  ASSERT_TRUE(error.contains("request")) << refused.out;
  const std::string id = error.value("request", "");
  EXPECT_THAT(refused.err, HasSubstr("(NOT_FOUND, request " + id + ")\n"));
  const Outcome local = Cairn({"eval", File("none.tum"), File("none.tum")});
  EXPECT_EQ(local.err.find("request"), std::string::npos) << local.err;

  server_->Signal(SIGTERM);
  const auto ended = server_->Wait();
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  std::vector<std::string> found;
  std::istringstream lines(ended.output);
  for (std::string line; std::getline(lines, line);) {
    const auto object = nlohmann::json::parse(line, nullptr, false);
    ASSERT_TRUE(object.is_object()) << line;
    if (object.value("request", "") == id) found.push_back(object.value("message", ""));
  }
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_THAT(found[0], HasSubstr("command job_cancel (job 999) of client "));
  EXPECT_THAT(found[0], HasSubstr(": NOT_FOUND, "));
}

}  // namespace
}  // namespace cairn::client
