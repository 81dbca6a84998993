#include "client/cli/top_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <utility>

#include "client/cli/text_output.h"

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

Job RunningJob(std::uint64_t id) {
  Job job;
  job.id = id;
  job.site = "hall";
  job.state = JobState::kRunning;
  return job;
}

MapInfo Site(const std::string& name) {
  MapInfo map;
  map.site = name;
  map.epoch = 4;
  map.tile_count = 37;
  map.robots = 2;
  map.enabled_version = 3;
  map.memory_bytes = 5U << 20U;
  return map;
}

// ROS 2 robots /r1, /r2, ... that are not on the map, with two problems each.
Ros2Report Ros2Robots(int robots) {
  Ros2Report report;
  report.door.enabled = true;
  for (int i = 1; i <= robots; ++i) {
    Ros2Namespace one;
    one.name = "/r" + std::to_string(i);
    one.problems = {"no odometry", "no transform of the lidar"};
    report.namespaces.push_back(one);
  }
  return report;
}

std::size_t LinesOf(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

// The words of the line that begins with the robot's name.
std::string LineOf(const std::string& text, const std::string& robot) {
  const std::size_t begin = text.find("\n" + robot) + 1;
  std::string line = text.substr(begin, text.find('\n', begin) - begin);
  for (std::size_t at; (at = line.find("  ")) != std::string::npos;) line.erase(at, 1);
  return line;
}

TEST(TopTable, RatesAreOfTheTimeBetweenTwoAnswers) {
  TopView before, now;
  before.status.robots = {Robot("r1", 100)};
  before.seconds = 10.0;
  now.status.robots = {Robot("r1", 125)};
  now.seconds = 12.0;
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
              HasSubstr("server: up 1.0 h, 125 % of a processor, 200 MiB of memory, 7 values queued\n"));
  EXPECT_THAT(FormatTop(now, nullptr), HasSubstr("up 1.0 h, 50 % of"));
  now.status.load.strand_wait_p50_ms = 0.21;
  now.status.load.strand_wait_p99_ms = 12.0;
  EXPECT_THAT(FormatTop(now, nullptr), HasSubstr("values queued, a thread free after 0.2 ms (p99 12.0 ms)\n"));
  std::swap(before, now);  // The server was started again.
  EXPECT_THAT(FormatTop(now, &before), HasSubstr("up 1.0 h, 50 % of"));
  for (const auto& [up_s, text] : {std::pair(12.0, "up 12 s, "), {600.0, "up 10 min, "}, {259200.0, "up 3.0 days, "}}) {
    now.status.load.up_s = up_s;
    EXPECT_THAT(FormatTop(now, nullptr), HasSubstr(text));
  }
  now.status.load = {};
  EXPECT_THAT(FormatTop(now, nullptr), Not(HasSubstr("server:")));
  now.status.load = {.up_s = 60.0,
                     .stores = true,
                     .store_bytes = 5U << 20U,
                     .stored_after_p50_ms = 101.0,
                     .stored_after_p99_ms = 125.4};
  EXPECT_THAT(FormatTop(now, nullptr), HasSubstr("; stored after 101 ms (p99 125 ms), 5 MiB on the disk\n"));
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
  Job done = RunningJob(6);
  done.state = JobState::kSucceeded;
  now.jobs = {RunningJob(7), done};
  const std::string text = FormatTop(now, nullptr);
  EXPECT_THAT(text, HasSubstr("DEGRADED: the disk is full"));
  EXPECT_EQ(LineOf(text, "gone"), "gone hall suspended - - - - 3 1.2 / 20.0");
  EXPECT_THAT(LineOf(text, "stuck"), HasSubstr(" stale "));
  EXPECT_THAT(text, HasSubstr("job 7"));
  EXPECT_THAT(text, Not(HasSubstr("job 6")));
}

TEST(TopTable, EachSiteHasALineWithItsUnfinishedJobs) {
  TopView now;
  now.maps = {Site("hall"), Site("yard")};
  Job done = RunningJob(6);
  done.state = JobState::kSucceeded;
  now.jobs = {RunningJob(7), RunningJob(8), done};
  const std::string text = "\n" + FormatTop(now, nullptr);
  EXPECT_THAT(LineOf(text, "SITE"), HasSubstr("VERSION EPOCH TILES MEMORY (MiB) JOBS"));
  EXPECT_EQ(LineOf(text, "hall"), "hall 2 3 4 37 5.0 2");
  EXPECT_EQ(LineOf(text, "yard"), "yard 2 3 4 37 5.0 0");
}

TEST(TopTable, SaysWhatIsWrongWithRos2Robots) {
  TopView now;
  now.ros2 = Ros2Robots(2);
  now.ros2.namespaces[1].on_map = true;
  now.ros2.namespaces[1].problems.clear();
  now.ros2.door.problems = {"two publishers contend for a frame"};
  EXPECT_THAT(FormatTop(now, nullptr),
              HasSubstr("ROS 2: 1 of 2 robots is not on the map, 3 problems; see `cairn ros2 doctor`\n"
                        "  ! two publishers contend for a frame\n  /r1: no odometry\n"));
  now.ros2.door.enabled = false;
  EXPECT_THAT(FormatTop(now, nullptr), Not(HasSubstr("ROS 2")));
}

// The line of `cairn status`, which names no problems.
TEST(TopTable, StatusSaysHowManyRos2RobotsAreNotOnTheMap) {
  Ros2Report report = Ros2Robots(3);
  report.namespaces[1].on_map = true;
  EXPECT_EQ(FormatRos2Door(report), "ROS 2: 2 of 3 robots are not on the map; see `cairn ros2 doctor`\n");
  for (Ros2Namespace& one : report.namespaces) one.on_map = true;
  EXPECT_EQ(FormatRos2Door(report), "");
  EXPECT_EQ(FormatRos2Door({}), "");
}

// Who looks at the status only must learn that the map is less than it was.
TEST(TopTable, StatusSaysWhatSitesHaveGivenUp) {
  std::vector<MapInfo> maps(2);
  maps[0].site = "lab";
  maps[1].site = "hall";
  EXPECT_EQ(FormatMemoryNotes(maps), "");
  maps[1].memory_note = "map versions removed: 2";
  EXPECT_EQ(FormatMemoryNotes(maps), "memory of site hall: map versions removed: 2\n");
}

TEST(TopTable, FitsTheTerminalAndSaysWhatIsMissing) {
  TopView now;
  now.status.load.up_s = 60.0;
  for (int i = 0; i < 50; ++i) {
    now.status.robots.push_back(Robot("robot" + std::to_string(i), 1));
    now.maps.push_back(Site("site" + std::to_string(i)));
    now.jobs.push_back(RunningJob(static_cast<std::uint64_t>(i)));
  }
  now.ros2 = Ros2Robots(50);
  EXPECT_GT(LinesOf(FormatTop(now, nullptr)), 250U);
  for (const int rows : {2, 5, 10, 24, 60, 200, 1000}) {
    const std::string text = FormatTop(now, nullptr, {.rows = rows, .columns = 40});
    EXPECT_LT(LinesOf(text), static_cast<std::size_t>(rows));
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 40U);
    if (rows < 24) continue;
    for (const char* part : {"server: up", "site0 ", "ROS 2: 50 of 50", "  /r1: no odometry", "job 0", "robot0 "})
      EXPECT_THAT(text, HasSubstr(part)) << rows;
  }
  // A quarter of 23 rows each; the robots get what is left.
  const std::string text = FormatTop(now, nullptr, {.rows = 24, .columns = 80});
  EXPECT_THAT(text, HasSubstr("  ... and 47 more\n")) << "of 51 lines of sites";
  EXPECT_THAT(text, HasSubstr("  ... and 97 more\n")) << "of 101 lines about ROS 2";
  EXPECT_EQ(LinesOf(text), 23U);
}

TEST(TopTable, WhatComesFromOtherProgramsDoesNotControlTheTerminal) {
  const TerminalSize wide = {.rows = 5, .columns = 10};
  EXPECT_EQ(FitTerminal("a\x1b[2Jb\x7f\xC2\x9Bz\n", wide), "a?[2Jb??z\n");
  EXPECT_EQ(FitTerminal("a\x9B"
                        "2Jb\xE2\x80\xA8z\n",
                        wide),
            "a?2Jb?z\n")
      << "some terminals obey single bytes";
  EXPECT_EQ(FitTerminal("\xC3\xA4\xC3\xB6\xC3\xBC\n", {.rows = 5, .columns = 2}), "\xC3\xA4\xC3\xB6\n");
  EXPECT_EQ(FitTerminal("one\ntwo\nthree\n", {.rows = 3, .columns = 80}), "one\ntwo\n");
  EXPECT_EQ(FitTerminal("a\x1b[2Jb\n", {}), "a\x1b[2Jb\n");
}

}  // namespace
}  // namespace cairn::client
