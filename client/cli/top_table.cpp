#include "client/cli/top_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "client/cli/text_output.h"
#include "common/code_points.h"

namespace cairn::client {
namespace {

using Row = std::vector<std::string>;
// Without line ends.
using Lines = std::vector<std::string>;

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

// The first row has the headings; all have as many cells.
Lines Aligned(const std::vector<Row>& rows) {
  std::vector<std::size_t> width(rows.front().size());
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) width[i] = std::max(width[i], row[i].size());
  }
  Lines lines;
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) line += fmt::format("{:<{}}  ", row[i], width[i]);
    lines.push_back(line.substr(0, line.find_last_not_of(' ') + 1));
  }
  return lines;
}

Lines SplitLines(const std::string& text) {
  Lines lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

// The parts of the table, from top to bottom.
Lines ServerLines(const TopView& now, const TopView* before) {
  return SplitLines((now.status.degraded.empty() ? "" : "DEGRADED: " + now.status.degraded + "\n") +
                    FormatLoad(now.status.load, before == nullptr ? nullptr : &before->status.load) +
                    FormatRefusals(now.status.refused));
}

Lines SiteLines(const TopView& now) {
  if (now.maps.empty()) return {};
  std::vector<Row> rows = {{"SITE", "ROBOTS", "VERSION", "EPOCH", "TILES", "MEMORY (MiB)", "JOBS"}};
  for (const MapInfo& map : now.maps) {
    const auto jobs =
        std::ranges::count_if(now.jobs, [&map](const Job& job) { return job.site == map.site && !IsFinal(job.state); });
    rows.push_back({map.site, std::to_string(map.robots), std::to_string(map.enabled_version),
                    std::to_string(map.epoch), std::to_string(map.tile_count),
                    fmt::format("{:.1f}", static_cast<double>(map.memory_bytes) / (1024.0 * 1024.0)),
                    std::to_string(jobs)});
  }
  return Aligned(rows);
}

Lines Ros2Lines(const Ros2Report& report) {
  Lines problems;
  for (const std::string& problem : report.door.problems) problems.push_back("  ! " + problem);
  for (const Ros2Namespace& one : report.namespaces) {
    for (const std::string& problem : one.problems) problems.push_back(fmt::format("  {}: {}", one.name, problem));
  }
  Lines lines = SplitLines(FormatRos2Door(report, problems.size()));
  if (!lines.empty()) lines.insert(lines.end(), problems.begin(), problems.end());
  return lines;
}

Lines JobLines(const TopView& now) {
  Lines lines;
  for (const Job& job : now.jobs) {
    if (!IsFinal(job.state)) lines.push_back(FormatJob(job));
  }
  return lines;
}

Lines RobotLines(const TopView& now, const TopView* before) {
  if (now.status.robots.empty()) return {"no robot yet"};
  std::vector<Row> rows = {
      {"ROBOT", "SITE", "STATE", "X Y (m) DEG", "+- m", "USED/s", "DROPPED/s", "WAITING", "LATENCY p50 / p99 (ms)"}};
  const double seconds = before == nullptr ? 0.0 : now.seconds - before->seconds;
  for (const RobotStatus& robot : now.status.robots)
    rows.push_back(RowOf(robot, Find(before, robot.session.robot), seconds));
  return Aligned(rows);
}

// At most so many lines, of which the last one then says how many are missing. REQUIRES most > 0.
void Cut(Lines& lines, std::size_t most) {
  if (lines.size() <= most) return;
  const std::size_t missing = lines.size() - (most - 1);
  lines.resize(most - 1);
  lines.push_back(fmt::format("  ... and {} more", missing));
}

// Sites, ROS 2 and jobs get at most a quarter of the terminal each, and robots the lines that are left.
void CutToHeight(std::vector<Lines>& parts, std::size_t rows) {
  constexpr std::size_t kFewest = 3;  // A heading, one line, and how many more.
  std::size_t left = rows;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const bool server = i == 0, robots = i + 1 == parts.size();
    if (!server) Cut(parts[i], robots ? std::max(kFewest, left) : std::max(kFewest, rows / 4));
    left -= std::min(left, parts[i].size());
  }
}

// As many characters as fit. Control characters, and bytes that are not UTF-8, become `?`.
std::string FitLine(std::string_view line, std::size_t columns) {
  std::string fitting;
  for (std::size_t characters = 0; !line.empty() && characters < columns; ++characters) {
    const CodePoint next = FirstCodePoint(line);
    const bool shown = next.bytes > 0 && !IsControl(next.value);
    fitting += shown ? line.substr(0, next.bytes) : std::string_view("?");
    line.remove_prefix(std::max<std::size_t>(1, next.bytes));
  }
  return fitting;
}

std::string Joined(const Lines& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

}  // namespace

std::string FitTerminal(const std::string& text, const TerminalSize& size) {
  if (size == TerminalSize{}) return text;
  Lines lines = SplitLines(text);
  // The cursor stands in the last row.
  if (size.rows > 1) lines.resize(std::min(lines.size(), static_cast<std::size_t>(size.rows - 1)));
  if (size.columns > 0) {
    for (std::string& line : lines) line = FitLine(line, static_cast<std::size_t>(size.columns));
  }
  return Joined(lines);
}

std::string FormatTop(const TopView& now, const TopView* before, const TerminalSize& size) {
  std::vector<Lines> parts = {ServerLines(now, before), SiteLines(now), Ros2Lines(now.ros2), JobLines(now),
                              RobotLines(now, before)};
  if (size.rows > 1) CutToHeight(parts, static_cast<std::size_t>(size.rows - 1));
  std::string text;
  for (const Lines& lines : parts) text += Joined(lines);
  return FitTerminal(text, size);
}

}  // namespace cairn::client
