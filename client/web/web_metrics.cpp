#include "client/web/web_metrics.h"

#include <fmt/format.h>

#include <map>
#include <string_view>
#include <vector>

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
        if (count > 0) dropped.Add(fmt::format("{},reason={}", sensor, Quoted(reason)), count);
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

std::string SiteMetrics(const std::vector<MapInfo>& maps, const std::vector<Job>& kept_jobs) {
  Metric tiles("cairn_map_tiles", "gauge", "Tiles of the map, of all levels.");
  Metric version("cairn_map_enabled_version", "gauge", "The map version that is enabled.");
  for (const MapInfo& map : maps) {
    const std::string labels = "site=" + Quoted(map.site);
    tiles.Add(labels, map.tile_count);
    version.Add(labels, map.enabled_version);
  }
  Metric jobs("cairn_jobs", "gauge", "Jobs that the server remembers, by state.");
  std::map<std::string, int> counts;
  for (const Job& job : kept_jobs)
    ++counts[fmt::format("site={},state={}", Quoted(job.site), Quoted(JobStateName(job.state)))];
  for (const auto& [labels, count] : counts) jobs.Add(labels, count);
  return tiles.text() + version.text() + jobs.text();
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
  std::string text = up.text() + processor.text() + memory.text() + waiting.text();
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
         RobotMetrics(view.status.robots) + SiteMetrics(view.maps, view.jobs);
}

}  // namespace cairn::web
