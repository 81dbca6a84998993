#include "client/web/web_metrics.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string_view>
#include <vector>

#include "common/sensor/stamp.h"

namespace cairn::web {
namespace {

// A value of a label. The three characters with a meaning are escaped; what else a name holds stays as it is.
std::string Quoted(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '\\' || c == '"') quoted += '\\';
    if (c == '\n') {
      quoted += "\\n";
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

// One metric: its samples must stand together below its description.
class Metric {
 public:
  Metric(std::string_view name, std::string_view type, std::string_view help)
      : name_(name), text_(fmt::format("# HELP {0} {2}\n# TYPE {0} {1}\n", name, type, help)) {}

  template <typename Value>
  void Add(std::string_view labels, Value value) {
    if (labels.empty()) {
      text_ += fmt::format("{} {}\n", name_, value);
    } else {
      text_ += fmt::format("{}{{{}}} {}\n", name_, labels, value);
    }
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string_view name_;
  std::string text_;
};

std::string RobotLabels(const RobotStatus& robot) {
  return fmt::format("site={},robot={}", Quoted(robot.session.site), Quoted(robot.session.robot));
}

std::string RobotMetrics(const std::vector<RobotStatus>& robots) {
  Metric alive("cairn_robot_alive", "gauge", "1 while the robot's client is alive.");
  Metric localized("cairn_robot_localized", "gauge", "1 while the robot's place is known.");
  Metric received("cairn_scans_received_total", "counter", "Scans that arrived.");
  Metric used("cairn_scans_used_total", "counter", "Scans that gave a pose.");
  Metric keyframes("cairn_keyframes_total", "counter", "Scans that changed the map.");
  Metric dropped("cairn_scans_dropped_total", "counter", "Scans that were not used, by reason.");
  Metric waiting("cairn_scans_waiting", "gauge", "Scans in the robot's queue.");
  Metric latency("cairn_scan_latency_seconds", "summary", "Scan received to pose published, of the last 256 scans.");
  for (const RobotStatus& robot : robots) {
    const std::string labels = RobotLabels(robot);
    alive.Add(labels, robot.alive ? 1 : 0);
    localized.Add(labels, robot.pose.localized ? 1 : 0);
    for (const Ledger& ledger : robot.ledgers) {
      if (ledger.sensor == "odometry") continue;
      const std::string sensor = fmt::format("{},sensor={}", labels, Quoted(ledger.sensor));
      received.Add(sensor, ledger.received);
      used.Add(sensor, ledger.used);
      keyframes.Add(sensor, ledger.keyframes);
      waiting.Add(sensor, ledger.waiting);
      for (int i = 0; i < kDropReasonCount; ++i) {
        const std::uint64_t count = ledger.dropped[static_cast<std::size_t>(i)];
        const auto reason = DropReasonName(static_cast<DropReason>(i));
        // Also 0: Prometheus sees a counter grow only after it has seen it once before.
        dropped.Add(fmt::format("{},reason={}", sensor, Quoted(reason)), count);
      }
      latency.Add(sensor + ",quantile=\"0.5\"", ledger.latency_p50_ms / 1000.0);
      latency.Add(sensor + ",quantile=\"0.99\"", ledger.latency_p99_ms / 1000.0);
    }
  }
  std::string text;
  for (const Metric* metric : {&alive, &localized, &received, &used, &keyframes, &dropped, &waiting, &latency})
    text += metric->text();
  return text;
}

std::string PoseReasonMetrics(const std::vector<RobotStatus>& robots) {
  Metric metric("cairn_robot_pose_reason", "gauge", "1 for the one reason that the robot's pose has now, else 0.");
  for (const RobotStatus& robot : robots) {
    for (int i = 0; i <= static_cast<int>(PoseReason::kNotJoined); ++i) {
      const auto reason = static_cast<PoseReason>(i);
      metric.Add(fmt::format("{},reason={}", RobotLabels(robot), Quoted(PoseReasonName(reason))),
                 robot.pose.reason == reason ? 1 : 0);
    }
  }
  return metric.text();
}

std::string MapMetrics(const std::vector<MapInfo>& maps) {
  Metric tiles("cairn_map_tiles", "gauge", "Tiles of the map, of all levels.");
  Metric version("cairn_map_enabled_version", "gauge", "The map version that is enabled.");
  Metric memory("cairn_site_memory_bytes", "gauge",
                "What the site's map and its versions take in the server's memory.");
  Metric above("cairn_site_memory_above_limit", "gauge",
               "1: the site's map takes more memory than it may, although all that is not needed was given up.");
  for (const MapInfo& map : maps) {
    const std::string labels = "site=" + Quoted(map.site);
    tiles.Add(labels, map.tile_count);
    version.Add(labels, map.enabled_version);
    memory.Add(labels, map.memory_bytes);
    above.Add(labels, map.memory_note.starts_with(kAboveMemoryLimit) ? 1 : 0);
  }
  return tiles.text() + version.text() + memory.text() + above.text();
}

// Of each site every state is written, also where no job has it, and the time of the last failure. The time, and not a
// count of failures, because it does not depend on what this process has seen: it is the same after a restart of this
// process, it does not fall when the server forgets older jobs, and a site that is loaded with old jobs has not failed
// just now.
std::string JobMetrics(const std::set<std::string>& known_sites, const std::vector<Job>& kept_jobs) {
  struct OfSite {
    std::array<int, static_cast<std::size_t>(JobState::kCancelled) + 1> counts{};
    Stamp last_failure = 0;
  };
  std::map<std::string, OfSite> sites;
  for (const std::string& site : known_sites) sites.try_emplace(site);
  for (const Job& job : kept_jobs) {
    OfSite& site = sites[job.site];
    const auto state = static_cast<std::size_t>(job.state);
    if (state < site.counts.size()) ++site.counts[state];
    if (job.state == JobState::kFailed) site.last_failure = std::max(site.last_failure, job.ended);
  }
  Metric jobs("cairn_jobs", "gauge", "Jobs that the server remembers, by state.");
  Metric failure("cairn_job_last_failure_timestamp_seconds", "gauge",
                 "When a job of the site failed last, in seconds since 1970 by the server's clock; 0 if none did.");
  for (const auto& [name, site] : sites) {
    const std::string labels = "site=" + Quoted(name);
    for (std::size_t i = 0; i < site.counts.size(); ++i)
      jobs.Add(fmt::format("{},state={}", labels, Quoted(JobStateName(static_cast<JobState>(i)))), site.counts[i]);
    failure.Add(labels, SecondsFromStamp(site.last_failure));
  }
  return jobs.text() + failure.text();
}

std::string Ros2Metrics(const Ros2Report& report) {
  std::uint64_t on_map = 0, not_on_map = 0;
  for (const Ros2Namespace& one : report.namespaces) {
    // The server remembers robots that are switched off; nobody publishes a topic of theirs.
    if (one.topics.empty()) continue;
    ++(one.on_map ? on_map : not_on_map);
  }
  Metric robots("cairn_ros2_robots", "gauge",
                "Namespaces in which a ROS 2 robot publishes, by whether it is on the map.");
  robots.Add("on_map=\"true\"", on_map);
  robots.Add("on_map=\"false\"", not_on_map);
  Metric refused("cairn_ros2_refused_total", "counter", "Messages of ROS 2 robots that could not be decoded.");
  refused.Add("", report.door.malformed);
  Metric overflow("cairn_ros2_overflow_total", "counter",
                  "Messages of ROS 2 robots that found no room in the server's queue.");
  overflow.Add("", report.door.overflow);
  Metric unpublished("cairn_ros2_unpublished_total", "counter",
                     "Messages to ROS 2 robots that could not be published.");
  unpublished.Add("", report.door.unpublished);
  return robots.text() + refused.text() + overflow.text() + unpublished.text();
}

std::string RefusalMetrics(const Refusals& refused) {
  Metric metric("cairn_refused_total", "counter",
                "What the server has refused because of its sender or of a limit, by kind.");
  metric.Add("kind=\"datagrams\"", refused.datagrams);
  metric.Add("kind=\"commands\"", refused.commands);
  metric.Add("kind=\"over_limit\"", refused.over_limit);
  if (refused.secure) {
    metric.Add("kind=\"peers\"", refused.peers);
    metric.Add("kind=\"endpoints\"", refused.endpoints);
    metric.Add("kind=\"samples\"", refused.samples);
  }
  return metric.text();
}

std::string LoadMetrics(const ServerLoad& load) {
  Metric up("cairn_server_up_seconds", "gauge", "Since the server's start.");
  up.Add("", load.up_s);
  Metric processor("cairn_server_processor_seconds_total", "counter", "Processor time of the server since its start.");
  processor.Add("", load.processor_s);
  Metric memory("cairn_server_memory_bytes", "gauge", "Memory of the server that is in RAM.");
  memory.Add("", load.memory_bytes);
  Metric waiting("cairn_server_waiting", "gauge", "Values in the server's queues that no thread has looked at yet.");
  waiting.Add("queue=\"inbound\"", load.inbound_waiting);
  waiting.Add("queue=\"outbound\"", load.outbound_waiting);
  Metric wait("cairn_server_strand_wait_seconds", "summary",
              "Time that work waits for a thread, of the last 4,096 turns.");
  wait.Add("quantile=\"0.5\"", load.strand_wait_p50_ms / 1000.0);
  wait.Add("quantile=\"0.99\"", load.strand_wait_p99_ms / 1000.0);
  std::string text = up.text() + processor.text() + memory.text() + waiting.text() + wait.text();
  if (!load.stores) return text;
  Metric commits("cairn_store_commits_total", "counter", "Commits of the server's store, by result.");
  commits.Add("result=\"stored\"", load.commits);
  commits.Add("result=\"failed\"", load.failed_commits);
  Metric bytes("cairn_store_bytes", "gauge", "What the records in the server's store take.");
  bytes.Add("", load.store_bytes);
  Metric delay("cairn_store_delay_seconds", "summary", "A change until it was on the disk, of the last 4,096 commits.");
  delay.Add("quantile=\"0.5\"", load.stored_after_p50_ms / 1000.0);
  delay.Add("quantile=\"0.99\"", load.stored_after_p99_ms / 1000.0);
  return text + commits.text() + bytes.text() + delay.text();
}

}  // namespace

std::string MetricsText(const ServerView& view) {
  Metric up("cairn_up", "gauge", "1 while the server answers.");
  up.Add("", view.connected ? 1 : 0);
  if (!view.connected) return up.text();
  Metric degraded("cairn_degraded", "gauge", "1 while the server cannot store new data, or did not restore all.");
  degraded.Add("", view.status.degraded.empty() ? 0 : 1);
  return up.text() + degraded.text() + LoadMetrics(view.status.load) + RefusalMetrics(view.status.refused) +
         RobotMetrics(view.status.robots) + PoseReasonMetrics(view.status.robots) + MapMetrics(view.maps) +
         JobMetrics(view.Sites(), view.jobs) + (view.ros2 != nullptr ? Ros2Metrics(*view.ros2) : std::string());
}

}  // namespace cairn::web
