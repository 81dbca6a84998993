#include "server/tools/offline/joint_run.h"

#include <algorithm>
#include <chrono>
#include <iomanip>
#include <iterator>
#include <sstream>
#include <utility>

#include "server/slam/site_options_of.h"

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;

double CpuSeconds() {
  OfflineReport usage;
  AddUsage(usage);
  return usage.cpu_s;
}

// The map frame is that of the first robot whose start is known, or else of the first robot.
std::size_t FrameOf(const OfflineOptions& options, const std::vector<slam::SmoothedSession>& smoothed) {
  const auto known = std::ranges::find_if(options.starts, [](const auto& start) { return start.has_value(); });
  return known == options.starts.end() ? smoothed.front().frame
                                       : static_cast<std::size_t>(known - options.starts.begin());
}

Result<void> WriteSmoothed(const OfflineOptions& options, const JointReport& report,
                           const std::vector<slam::MapperSnapshot>& snapshots) {
  for (std::size_t i = 0; i < options.smoothed_trajectories.size(); ++i) {
    auto written =
        WriteTum(snapshots[i].TrajectoryAlong(report.robots[i].smoothed.path), options.smoothed_trajectories[i]);
    if (!written) return written;
  }
  if (options.smoothed_map.empty()) return {};
  slam::OccupancyGrid grid(options.slam.grid);
  for (std::size_t i = 0; i < snapshots.size(); ++i) {
    if (!report.robots[i].in_map) continue;
    const std::vector<slam::Keyframe>& keyframes = snapshots[i].keyframes;
    for (std::size_t k = 0; k < keyframes.size(); ++k)
      if (keyframes[k].localized) grid.Draw(*keyframes[k].scan, report.robots[i].smoothed.path[k]);
  }
  return WriteMap(grid, options.smoothed_map);
}

}  // namespace

Result<JointReport> RunJoint(const OfflineOptions& options) {
  const Clock::time_point start = Clock::now();
  JointReport report;
  std::vector<slam::MapperSnapshot> snapshots;
  for (std::size_t i = 0; i < options.logs.size(); ++i) {
    const Clock::time_point began = Clock::now();
    const double cpu_before = CpuSeconds();
    auto robot = Estimate(options, options.logs[i], options.starts[i].value_or(Pose2{}));
    if (!robot) return tl::unexpected<Status>(robot.error());
    AddUsage(robot->report);
    robot->report.cpu_s -= cpu_before;
    robot->report.wall_s = std::chrono::duration<double>(Clock::now() - began).count();
    if (!options.trajectories.empty()) {
      auto written = WriteTum(robot->online, options.trajectories[i]);
      if (!written) return tl::unexpected<Status>(written.error());
    }
    snapshots.push_back(robot->pipeline->mapper().Snapshot());
    if (auto written = WriteKnown(options, i, snapshots.back()); !written)
      return tl::unexpected<Status>(written.error());
    report.robots.push_back({.log = options.logs[i], .report = std::move(robot->report), .smoothed = {}});
  }

  const double cpu_before = CpuSeconds();
  std::vector<slam::SiteSession> sessions;
  for (std::size_t i = 0; i < snapshots.size(); ++i) sessions.push_back({snapshots[i], options.starts[i].has_value()});
  auto smoothed = slam::SmoothSessions(sessions, SiteOptionsOf(options.slam), [](double /*share*/) { return true; });
  report.smoothing_s = CpuSeconds() - cpu_before;
  const std::size_t frame = FrameOf(options, *smoothed);
  for (std::size_t i = 0; i < snapshots.size(); ++i) {
    JointRobot& robot = report.robots[i];
    robot.smoothed = std::move((*smoothed)[i]);
    const bool placed_by_start = options.starts[robot.smoothed.frame] && options.starts[frame];
    robot.in_map = robot.smoothed.frame == frame || placed_by_start;
  }
  if (auto written = WriteSmoothed(options, report, snapshots); !written)
    return tl::unexpected<Status>(written.error());
  OfflineReport usage;
  AddUsage(usage);
  report.cpu_s = usage.cpu_s;
  report.peak_rss_mib = usage.peak_rss_mib;
  report.wall_s = std::chrono::duration<double>(Clock::now() - start).count();
  return report;
}

std::string JointText(const JointReport& report) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(2);
  for (const JointRobot& robot : report.robots) {
    const slam::SmoothedSession& smoothed = robot.smoothed;
    out << robot.log.string() << '\n' << ReportText(robot.report);
    out << "smoothed   ";
    if (smoothed.joined) {
      out << "joined by " << smoothed.relations << " relations, " << smoothed.withdrawn << " withdrawn; "
          << 100.0 * smoothed.agreement << " % of what others saw agrees; moved by " << smoothed.T_site_own.x << ' '
          << smoothed.T_site_own.y << ' ' << smoothed.T_site_own.theta << '\n';
    } else {
      out << "not joined: no place is surely one that another robot has seen\n";
    }
    if (!robot.in_map) out << "           its place in the joint map is not known, and it is not drawn\n";
  }
  out << "all        " << report.smoothing_s << " s of processor time for the joint smoothing, " << report.cpu_s
      << " s in all, " << report.peak_rss_mib << " MiB at the most\n";
  return out.str();
}

Json JsonOf(const JointReport& report) {
  Json robots = Json::array();
  for (const JointRobot& robot : report.robots) {
    Json one = {{"log", robot.log.string()}};
    one.update(JsonOf(robot.report));
    const slam::SmoothedSession& smoothed = robot.smoothed;
    one["joined"] = smoothed.joined;
    one["in_map"] = robot.in_map;
    one["frame"] = smoothed.frame;
    one["T_site_own"] = {smoothed.T_site_own.x, smoothed.T_site_own.y, smoothed.T_site_own.theta};
    one["relations"] = smoothed.relations;
    one["withdrawn"] = smoothed.withdrawn;
    one["agreement"] = smoothed.agreement;
    robots.push_back(std::move(one));
  }
  return {{"robots", std::move(robots)},
          {"smoothing_s", report.smoothing_s},
          {"cpu_s", report.cpu_s},
          {"wall_s", report.wall_s},
          {"peak_rss_mib", report.peak_rss_mib}};
}

}  // namespace cairn::server
