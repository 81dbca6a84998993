#include "client/cli/top_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

RobotStatus Robot(const std::string& name, std::uint64_t used) {
  RobotStatus robot;
  robot.session.robot = name;
  robot.session.site = "hall";
  robot.pose.reason = PoseReason::kTracking;
  robot.pose.stamp = 1;
  robot.pose.T_map_robot = {1.5, -2.25, 1.5707963};
  robot.pose.covariance(0, 0) = 0.0004;
  Ledger laser;
  laser.sensor = "laser";
  laser.used = used;
  laser.waiting = 3;
  laser.latency_p50_ms = 1.25;
  laser.latency_p99_ms = 20.0;
  Ledger odometry;
  odometry.sensor = "odometry";
  odometry.used = 999;
  robot.ledgers = {laser, odometry};
  return robot;
}

// The words of the line that begins with the robot's name.
std::string LineOf(const std::string& text, const std::string& robot) {
  const std::size_t begin = text.find("\n" + robot) + 1;
  std::string line = text.substr(begin, text.find('\n', begin) - begin);
  for (std::size_t at; (at = line.find("  ")) != std::string::npos;) line.erase(at, 1);
  return line;
}

TEST(TopTable, RatesAreOfTheTimeBetweenTwoAnswers) {
  TopView before{
      .status = {.robots = {Robot("r1", 100)}, .degraded = {}, .refused = {}, .load = {}}, .jobs = {}, .seconds = 10.0};
  TopView now{
      .status = {.robots = {Robot("r1", 125)}, .degraded = {}, .refused = {}, .load = {}}, .jobs = {}, .seconds = 12.0};
  EXPECT_EQ(LineOf(FormatTop(now, &before), "r1"), "r1 hall tracking 1.50 -2.25 90 0.02 12.5 0.0 3 1.2 / 20.0");
  EXPECT_EQ(LineOf(FormatTop(now, nullptr), "r1"), "r1 hall tracking 1.50 -2.25 90 0.02 - - 3 1.2 / 20.0");
  now.status.robots[0] = Robot("r1", 7);  // A new session.
  EXPECT_EQ(LineOf(FormatTop(now, &before), "r1"), "r1 hall tracking 1.50 -2.25 90 0.02 - 0.0 3 1.2 / 20.0");
}

TEST(TopTable, TheServersLoadIsThatSinceTheLastAnswer) {
  TopView before, now;
  before.status.load = {.up_s = 3600.0, .processor_s = 1800.0, .memory_bytes = 100U << 20U};
  now.status.load = {
      .up_s = 3602.0, .processor_s = 1802.5, .memory_bytes = 200U << 20U, .inbound_waiting = 3, .outbound_waiting = 4};
  EXPECT_THAT(FormatTop(now, &before),
              HasSubstr("server: up 1.0 h, 125 % of a processor, 200 MiB of memory, 7 values wait in it\n"));
  EXPECT_THAT(FormatTop(now, nullptr), HasSubstr("up 1.0 h, 50 % of"));
  std::swap(before, now);  // The server was started again.
  EXPECT_THAT(FormatTop(now, &before), HasSubstr("up 1.0 h, 50 % of"));
  now.status.load = {};
  EXPECT_THAT(FormatTop(now, nullptr), Not(HasSubstr("server:")));
  now.status.load = {.up_s = 60.0,
                     .stores = true,
                     .store_bytes = 5U << 20U,
                     .stored_after_p50_ms = 101.0,
                     .stored_after_p99_ms = 125.4};
  EXPECT_THAT(FormatTop(now, nullptr), HasSubstr("; on the disk after 101 ms (p99 125 ms), 5 MiB there\n"));
}

TEST(TopTable, SaysWhatIsNotAsUsual) {
  TopView now;
  EXPECT_THAT(FormatTop(now, nullptr), HasSubstr("no robot yet"));
  RobotStatus gone = Robot("gone", 1), stale = Robot("stuck", 1);
  gone.session.phase = SessionPhase::kSuspended;
  gone.pose = {};
  stale.session.stale = true;
  now.status.robots = {gone, stale};
  now.status.degraded = "the disk is full";
  Job running, done;
  running.id = 7;
  running.site = "hall";
  running.state = JobState::kRunning;
  done = running;
  done.id = 6;
  done.state = JobState::kSucceeded;
  now.jobs = {running, done};
  const std::string text = FormatTop(now, nullptr);
  EXPECT_THAT(text, HasSubstr("DEGRADED: the disk is full"));
  EXPECT_EQ(LineOf(text, "gone"), "gone hall suspended - - - - 3 1.2 / 20.0");
  EXPECT_THAT(LineOf(text, "stuck"), HasSubstr(" stale "));
  EXPECT_THAT(text, HasSubstr("job 7"));
  EXPECT_THAT(text, Not(HasSubstr("job 6")));
}

}  // namespace
}  // namespace cairn::client
