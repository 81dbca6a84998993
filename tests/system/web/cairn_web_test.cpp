// cairn-web as a process: the token of those who may send commands does not get into a log, and the log has the form
// that was asked for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <string>
#include <vector>

#include "tests/child_process.h"
#include "tests/test_domain.h"

namespace cairn::test {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::vector<std::string> Page(const std::string& token) {
  return {"/usr/bin/env", "--unset=CAIRN_WEB_TOKEN",    CAIRN_WEB_PATH, "--port", "0",
          "--domain",     std::to_string(TestDomain()), token};
}

TEST(WebToken, IsNotPrintedWhereItWasGiven) {
  ChildProcess page(Page("--token=of-the-test"));
  ASSERT_TRUE(page.Says("http://127.0.0.1:"));
  page.Signal(SIGTERM);
  const auto outcome = page.Wait();
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.output, Not(HasSubstr("of-the-test")));
}

// A service: what it prints is kept.
TEST(WebToken, IsNotDrawnWhereNoTerminalShowsIt) {
  const auto outcome = ChildProcess(Page("--token")).Wait();
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.output, HasSubstr("CAIRN_WEB_TOKEN"));
  EXPECT_THAT(outcome.output, Not(HasSubstr("#token=")));
}

TEST(WebToken, IsShownOnATerminal) {
  std::string command = "exec";
  for (const std::string& word : Page("--token")) command += " '" + word + "'";
  ChildProcess terminal(
      {"/usr/bin/env", "SHELL=/bin/sh", "script", "--quiet", "--return", "--command", command, "/dev/null"});
  EXPECT_TRUE(terminal.Says("#token="));
  terminal.Signal(SIGTERM);
  terminal.Wait();
}

TEST(WebLog, SaysInItsFormatWhyTheStartFailed) {
  for (const std::string format : {"text", "json"}) {
    const auto outcome = ChildProcess({CAIRN_WEB_PATH, "--port", "0", "--log-format", format, "--domain",
                                       std::to_string(TestDomain()), "--set", "wire.interfaces=192.0.2.77"})
                             .Wait();
    EXPECT_EQ(outcome.exit_code, 1) << outcome.output;
    EXPECT_THAT(outcome.output, HasSubstr("192.0.2.77"));
    EXPECT_THAT(outcome.output, StartsWith(format == "json" ? "{\"time\":\"" : "cairn-web: "));
    EXPECT_THAT(outcome.output, EndsWith(format == "json" ? "\"}\n" : "\n"));
  }
  EXPECT_EQ(ChildProcess({CAIRN_WEB_PATH, "--log-format", "xml"}).Wait().exit_code, 2);
}

}  // namespace
}  // namespace cairn::test
