#include "server/ops/logging.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <thread>
#include <vector>

#include "server/ops/log_context.h"
#include "tests/server/support/captured_log.h"

namespace cairn::server::testing {
namespace {

using ::testing::MatchesRegex;
using ::testing::SizeIs;

LogSubject SubjectOf(const std::string& robot) {
  LogSubject fields;
  fields.robot = robot;
  return fields;
}

TEST(Logging, TextIsALineWithTimeLevelAndMessage) {
  CapturedLog log(LogLevel::kWarn, LogFormat::kText);
  spdlog::info("not wanted");
  spdlog::warn("the disk is {}\nforged", "full");
  const auto lines = log.Take();
  ASSERT_THAT(lines, SizeIs(1));
  EXPECT_THAT(lines[0], MatchesRegex("[0-9]+-[0-9]+-[0-9]+T[0-9:]+\\.[0-9]+Z warning the disk is full.nforged"));
}

TEST(Logging, ALineCarriesTheInnermostContextOfItsThread) {
  CapturedLog log(LogLevel::kInfo, LogFormat::kJson);
  {
    const LogContext outer(SubjectOf("r1"));
    spdlog::info("outer");
    {
      LogSubject fields;
      fields.job = 7;
      const LogContext inner(fields);
      spdlog::info("inner");
    }
    std::thread([] { spdlog::info("another thread"); }).join();
    spdlog::info("outer again");
  }
  spdlog::info("none");
  const auto lines = log.TakeObjects();
  ASSERT_THAT(lines, SizeIs(5));
  EXPECT_EQ(lines[0]["robot"], "r1");
  EXPECT_FALSE(lines[1].contains("robot"));
  EXPECT_EQ(lines[1]["job"], 7);
  EXPECT_FALSE(lines[2].contains("robot"));
  EXPECT_EQ(lines[3]["message"], "outer again");
  EXPECT_EQ(lines[3]["robot"], "r1");
  EXPECT_FALSE(lines[4].contains("robot"));
}

TEST(Logging, LinesOfManyThreadsStayWhole) {
  constexpr int kThreads = 4, kLines = 200;
  CapturedLog log(LogLevel::kInfo, LogFormat::kJson);
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([i] {
      const LogContext context(SubjectOf(std::to_string(i)));
      for (int k = 0; k < kLines; ++k) spdlog::info("of robot {}", i);
    });
  }
  for (std::thread& thread : threads) thread.join();
  const auto lines = log.TakeObjects();
  ASSERT_THAT(lines, SizeIs(kThreads * kLines));
  for (const auto& line : lines) EXPECT_EQ(line["message"], "of robot " + line["robot"].get<std::string>());
}

}  // namespace
}  // namespace cairn::server::testing
