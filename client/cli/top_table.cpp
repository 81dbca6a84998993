#include "client/cli/top_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

constexpr int kColumns = 9;
using Row = std::array<std::string, kColumns>;

// Sums over the lasers of a robot, and the worst latency of them.
struct Flow {
  std::uint64_t used = 0;
  std::uint64_t dropped = 0;
  std::uint64_t waiting = 0;
  double latency_p50_ms = 0.0;
  double latency_p99_ms = 0.0;
};

Flow FlowOf(const RobotStatus& robot) {
  Flow flow;
  for (const Ledger& ledger : robot.ledgers) {
    if (ledger.sensor == "odometry") continue;
    flow.used += ledger.used;
    flow.dropped += ledger.dropped_total();
    flow.waiting += ledger.waiting;
    flow.latency_p50_ms = std::max(flow.latency_p50_ms, ledger.latency_p50_ms);
    flow.latency_p99_ms = std::max(flow.latency_p99_ms, ledger.latency_p99_ms);
  }
  return flow;
}

std::string StateOf(const RobotStatus& robot) {
  if (robot.session.stale) return "stale";
  if (robot.session.phase != SessionPhase::kActive) return std::string(SessionPhaseName(robot.session.phase));
  return std::string(PoseReasonName(robot.pose.reason));
}

// A robot whose counts are lower than before is in a new session: its rate is not known.
std::string RateText(std::uint64_t count, std::uint64_t before, double seconds) {
  if (count < before || seconds <= 0.0) return "-";
  return fmt::format("{:.1f}", static_cast<double>(count - before) / seconds);
}

Row RowOf(const RobotStatus& robot, const RobotStatus* before, double seconds) {
  const PoseReport& pose = robot.pose;
  const Flow flow = FlowOf(robot);
  const double sigma_m = std::sqrt(std::max({0.0, pose.covariance(0, 0), pose.covariance(1, 1)}));
  Row row = {robot.session.robot,
             robot.session.site,
             StateOf(robot),
             "-",
             "-",
             "-",
             "-",
             std::to_string(flow.waiting),
             fmt::format("{:.1f} / {:.1f}", flow.latency_p50_ms, flow.latency_p99_ms)};
  if (pose.stamp != 0) {
    row[3] = fmt::format("{:.2f} {:.2f} {:.0f}", pose.T_map_robot.x, pose.T_map_robot.y,
                         pose.T_map_robot.theta * 180.0 / std::numbers::pi);
    row[4] = fmt::format("{:.2f}", sigma_m);
  }
  if (before != nullptr) {
    row[5] = RateText(flow.used, FlowOf(*before).used, seconds);
    row[6] = RateText(flow.dropped, FlowOf(*before).dropped, seconds);
  }
  return row;
}

const RobotStatus* Find(const TopView* view, const std::string& robot) {
  if (view == nullptr) return nullptr;
  const auto found = std::ranges::find_if(view->status.robots,
                                          [&](const RobotStatus& status) { return status.session.robot == robot; });
  return found == view->status.robots.end() ? nullptr : &*found;
}

std::string Aligned(const std::vector<Row>& rows) {
  std::array<std::size_t, kColumns> width{};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) width[i] = std::max(width[i], row[i].size());
  }
  std::string text;
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) line += fmt::format("{:<{}}  ", row[i], width[i]);
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  return text;
}

}  // namespace

std::string FormatTop(const TopView& now, const TopView* before) {
  std::string text;
  if (!now.status.degraded.empty()) text += "DEGRADED: " + now.status.degraded + "\n";
  std::vector<Row> rows = {
      {"ROBOT", "SITE", "STATE", "X Y (m) DEG", "+- m", "USED/s", "DROPPED/s", "WAITING", "LATENCY p50 / p99 (ms)"}};
  const double seconds = before == nullptr ? 0.0 : now.seconds - before->seconds;
  for (const RobotStatus& robot : now.status.robots)
    rows.push_back(RowOf(robot, Find(before, robot.session.robot), seconds));
  text += now.status.robots.empty() ? "no robot yet\n" : Aligned(rows);
  for (const Job& job : now.jobs) {
    if (!IsFinal(job.state)) text += FormatJob(job) + "\n";
  }
  return text + FormatLoad(now.status.load, before == nullptr ? nullptr : &before->status.load) +
         FormatRefusals(now.status.refused);
}

}  // namespace cairn::client
