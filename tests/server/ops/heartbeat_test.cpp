#include "server/ops/heartbeat.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

using std::chrono::seconds;

TEST(Heartbeat, NamesTheStrandThatDoesNotAnswerInTime) {
  Heartbeat heartbeat(seconds(5));
  std::function<void()> answer;
  const std::map<std::string, Heartbeat::Ask> strands = {
      {"quick", [](std::function<void()> done) { return done(), true; }},
      {"slow", [&answer](std::function<void()> done) { return answer = std::move(done), true; }}};
  const Heartbeat::Clock::time_point start{};
  EXPECT_TRUE(heartbeat.Check(strands, start).empty());
  EXPECT_TRUE(heartbeat.Check(strands, start + seconds(4)).empty());
  EXPECT_EQ(heartbeat.Check(strands, start + seconds(6)), std::vector<std::string>{"slow"});
  answer();
  EXPECT_TRUE(heartbeat.Check(strands, start + seconds(7)).empty());
  EXPECT_EQ(heartbeat.Check(strands, start + seconds(13)), std::vector<std::string>{"slow"});
}

TEST(Heartbeat, AStrandThatTakesNothingIsStalledToo) {
  Heartbeat heartbeat(seconds(5));
  const std::map<std::string, Heartbeat::Ask> strands = {{"full", [](const std::function<void()>&) { return false; }}};
  const Heartbeat::Clock::time_point start{};
  EXPECT_TRUE(heartbeat.Check(strands, start).empty());
  EXPECT_EQ(heartbeat.Check(strands, start + seconds(6)).size(), 1U);
}

TEST(Heartbeat, ForgetsStrandsThatAreGone) {
  Heartbeat heartbeat(seconds(5));
  const Heartbeat::Clock::time_point start{};
  EXPECT_TRUE(heartbeat.Check({{"a", [](const std::function<void()>&) { return true; }}}, start).empty());
  EXPECT_TRUE(heartbeat.Check({}, start + seconds(9)).empty());
}

}  // namespace
}  // namespace cairn::server
