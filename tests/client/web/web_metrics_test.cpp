// The figures for monitoring, from views that the tests fill themselves.
#include "client/web/web_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

namespace cairn::web {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

ServerView Answering() {
  ServerView view;
  view.connected = true;
  return view;
}

Job JobOf(const std::string& site, JobState state, Stamp ended = 0) {
  Job job;
  job.site = site;
  job.state = state;
  job.ended = ended;
  return job;
}

TEST(Metrics, NamesAreQuotedAndSamplesOfAMetricStandTogether) {
  ServerView view;
  view.connected = true;
  view.status.robots.resize(2);
  view.status.robots[0].session.site = "a\"b\\c\nd";
  for (RobotStatus& robot : view.status.robots) {
    robot.ledgers.resize(1);
    robot.ledgers[0].sensor = "laser";
    robot.ledgers[0].used = 7;
    robot.ledgers[0].latency_p99_ms = 25.0;
  }
  const std::string text = MetricsText(view);
  EXPECT_THAT(text, HasSubstr(R"(cairn_scans_used_total{site="a\"b\\c\nd",robot="",sensor="laser"} 7)"
                              "\n"
                              R"(cairn_scans_used_total{site="",robot="",sensor="laser"} 7)"));
  EXPECT_THAT(text, HasSubstr("quantile=\"0.99\"} 0.025\n"));
}

TEST(Metrics, AServerThatStoresNothingHasNoFiguresOfItsStore) {
  ServerView view;
  view.connected = true;
  view.status.load = {.up_s = 60.0, .processor_s = 3.5, .memory_bytes = 1U << 20U, .outbound_waiting = 4};
  const std::string in_memory = MetricsText(view);
  EXPECT_THAT(in_memory, HasSubstr("\ncairn_server_processor_seconds_total 3.5\n"));
  EXPECT_THAT(in_memory, HasSubstr("\ncairn_server_memory_bytes 1048576\n"));
  EXPECT_THAT(in_memory, HasSubstr("\ncairn_server_waiting{queue=\"outbound\"} 4\n"));
  EXPECT_THAT(in_memory, Not(HasSubstr("cairn_store")));
  view.status.load.stores = true;
  view.status.load.failed_commits = 2;
  view.status.load.stored_after_p99_ms = 125.0;
  EXPECT_THAT(MetricsText(view), HasSubstr("\ncairn_store_commits_total{result=\"failed\"} 2\n"));
  EXPECT_THAT(MetricsText(view), HasSubstr("\ncairn_store_delay_seconds{quantile=\"0.99\"} 0.125\n"));
}

// An alert that looks for growth does not see the first of something that was never written as 0.
TEST(Metrics, EveryReasonAndStateIsThereBeforeItCounts) {
  ServerView view = Answering();
  view.status.robots.resize(1);
  view.status.robots[0].session.site = "hall";
  view.status.robots[0].session.robot = "r1";
  view.status.robots[0].ledgers.resize(1);
  view.status.robots[0].ledgers[0].sensor = "laser";
  view.maps.resize(1);
  view.maps[0].site = "yard";
  const std::string text = MetricsText(view);
  for (int i = 0; i < kDropReasonCount; ++i) {
    const std::string reason(DropReasonName(static_cast<DropReason>(i)));
    EXPECT_THAT(text, HasSubstr("\ncairn_scans_dropped_total{site=\"hall\",robot=\"r1\",sensor=\"laser\",reason=\"" +
                                reason + "\"} 0\n"));
  }
  for (const std::string site : {"hall", "yard"}) {
    for (int i = 0; JobStateName(static_cast<JobState>(i)) != "unknown"; ++i) {
      const std::string state(JobStateName(static_cast<JobState>(i)));
      EXPECT_THAT(text, HasSubstr("\ncairn_jobs{site=\"" + site + "\",state=\"" + state + "\"} 0\n"));
    }
    EXPECT_THAT(text, HasSubstr("\ncairn_job_last_failure_timestamp_seconds{site=\"" + site + "\"} 0\n"));
  }
}

TEST(Metrics, TheLastFailureOfASiteStaysWhenOlderJobsAreForgotten) {
  ServerView view = Answering();
  view.jobs = {JobOf("hall", JobState::kFailed, 2500 * kNanosPerSecond),
               JobOf("hall", JobState::kFailed, 1784000000 * kNanosPerSecond),
               JobOf("hall", JobState::kSucceeded, 1784000100 * kNanosPerSecond),
               JobOf("yard", JobState::kCancelled, 1784000200 * kNanosPerSecond)};
  const std::string last = "\ncairn_job_last_failure_timestamp_seconds{site=\"hall\"} 1784000000\n";
  EXPECT_THAT(MetricsText(view), HasSubstr("\ncairn_jobs{site=\"hall\",state=\"failed\"} 2\n"));
  EXPECT_THAT(MetricsText(view), HasSubstr(last));
  EXPECT_THAT(MetricsText(view), HasSubstr("\ncairn_job_last_failure_timestamp_seconds{site=\"yard\"} 0\n"));
  view.jobs.erase(view.jobs.begin());
  EXPECT_THAT(MetricsText(view), HasSubstr("\ncairn_jobs{site=\"hall\",state=\"failed\"} 1\n"));
  EXPECT_THAT(MetricsText(view), HasSubstr(last));
}

TEST(Metrics, APoseHasOneReason) {
  ServerView view = Answering();
  view.status.robots.resize(1);
  for (int now = 0; PoseReasonName(static_cast<PoseReason>(now)) != "unknown"; ++now) {
    view.status.robots[0].pose.reason = static_cast<PoseReason>(now);
    const std::string text = MetricsText(view);
    for (int i = 0; PoseReasonName(static_cast<PoseReason>(i)) != "unknown"; ++i) {
      const std::string reason(PoseReasonName(static_cast<PoseReason>(i)));
      EXPECT_THAT(text, HasSubstr("\ncairn_robot_pose_reason{site=\"\",robot=\"\",reason=\"" + reason + "\"} " +
                                  (i == now ? "1" : "0") + "\n"));
    }
  }
}

TEST(Metrics, MemoryIsThatOfEachSiteAndWaitsAreInSeconds) {
  ServerView view = Answering();
  view.maps.resize(2);
  view.maps[0].site = "hall";
  view.maps[0].memory_bytes = 5000000000;
  view.maps[0].memory_note = std::string(kAboveMemoryLimit) + ", and all that is left is needed";
  view.maps[1].site = "yard";
  view.maps[1].memory_note = "to stay below the limit of memory: map versions removed: 1";
  view.status.load.strand_wait_p50_ms = 0.5;
  view.status.load.strand_wait_p99_ms = 125.0;
  const std::string text = MetricsText(view);
  EXPECT_THAT(text, HasSubstr("\ncairn_site_memory_bytes{site=\"hall\"} 5000000000\n"));
  EXPECT_THAT(text, HasSubstr("\ncairn_site_memory_bytes{site=\"yard\"} 0\n"));
  EXPECT_THAT(text, HasSubstr("\ncairn_site_memory_above_limit{site=\"hall\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("\ncairn_site_memory_above_limit{site=\"yard\"} 0\n"));
  EXPECT_THAT(text, HasSubstr("\ncairn_server_strand_wait_seconds{quantile=\"0.5\"} 0.0005\n"));
  EXPECT_THAT(text, HasSubstr("\ncairn_server_strand_wait_seconds{quantile=\"0.99\"} 0.125\n"));
}

TEST(Metrics, Ros2RobotsCountWhileTheyPublish) {
  ServerView view = Answering();
  EXPECT_THAT(MetricsText(view), Not(HasSubstr("cairn_ros2"))) << "the server serves none";
  Ros2Report report;
  report.door.malformed = 3;
  report.door.overflow = 4;
  report.door.unpublished = 5;
  report.namespaces.resize(4);
  for (Ros2Namespace& one : report.namespaces) one.topics.resize(1);
  report.namespaces[0].on_map = true;
  report.namespaces[3].topics.clear();
  view.ros2 = std::make_shared<const Ros2Report>(report);
  const std::string text = MetricsText(view);
  EXPECT_THAT(text, HasSubstr("\ncairn_ros2_robots{on_map=\"true\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("\ncairn_ros2_robots{on_map=\"false\"} 2\n"));
  EXPECT_THAT(text, HasSubstr("\ncairn_ros2_refused_total 3\n"));
  EXPECT_THAT(text, HasSubstr("\ncairn_ros2_overflow_total 4\n"));
  EXPECT_THAT(text, HasSubstr("\ncairn_ros2_unpublished_total 5\n"));
}

}  // namespace
}  // namespace cairn::web
