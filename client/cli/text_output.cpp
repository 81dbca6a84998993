#include "client/cli/text_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "client/cli/quantity_text.h"
#include "common/sensor/stamp.h"

namespace cairn::client {
namespace {

constexpr double kMib = 1024.0 * 1024.0;

std::string FormatStamps(const StampSummary& stamps) {
  return fmt::format("{} over {}, {:.1f} Hz, p99 period {}, longest gap {}", stamps.count,
                     FormatDuration(stamps.duration_s), stamps.rate_hz, FormatDuration(stamps.period_p99_s),
                     FormatDuration(stamps.longest_gap_s));
}

std::string Counted(std::uint64_t count, std::string_view thing) {
  return fmt::format("{} {}{}", count, thing, count == 1 ? "" : "s");
}

// In the unit in which a person would say it.
std::string FormatUpTime(double seconds) {
  if (seconds < 60.0) return fmt::format("{:.0f} s", seconds);
  if (seconds < 3600.0) return fmt::format("{:.0f} min", seconds / 60.0);
  if (seconds < 48.0 * 3600.0) return fmt::format("{:.1f} h", seconds / 3600.0);
  return fmt::format("{:.1f} days", seconds / 86400.0);
}

}  // namespace

std::string FormatPose(const PoseReport& pose) {
  const double sigma_m = std::sqrt(std::max(0.0, std::max(pose.covariance(0, 0), pose.covariance(1, 1))));
  const double sigma_rad = std::sqrt(std::max(0.0, pose.covariance(2, 2)));
  return fmt::format(
      "{} in {} at {}: x {:.3f} m  y {:.3f} m  theta {:.4f} rad  (+-{:.3f} m, +-{:.4f} rad)  {}, score {:.2f}, epoch "
      "{}",
      pose.robot, pose.site, FormatStamp(pose.stamp), pose.T_map_robot.x, pose.T_map_robot.y, pose.T_map_robot.theta,
      sigma_m, sigma_rad, PoseReasonName(pose.reason), pose.score, pose.map_epoch);
}

std::string FormatJob(const Job& job) {
  const std::string what = job.robot.empty() ? job.site : job.robot + " in " + job.site;
  std::string line = fmt::format("job {}: {} of {}, {}, {:.0f} %", job.id, JobKindName(job.kind), what,
                                 JobStateName(job.state), 100 * job.progress);
  if (job.ended > job.started && job.started > 0)
    line += ", took " + FormatDuration(SecondsFromStamp(job.ended - job.started));
  if (job.state == JobState::kSucceeded) {
    // A job that had nothing to join has made no map to compare.
    if (job.map_version > 0 && job.kind != JobKind::kRelocalise)
      line += fmt::format(", disagreement of scans and map {:.0f} -> {:.0f} mm", 1000 * std::sqrt(job.cost_before),
                          1000 * std::sqrt(job.cost_after));
    if (job.map_version > 0) line += fmt::format(", map version {}", job.map_version);
  }
  if (!job.message.empty()) line += ": " + job.message;
  return line;
}

std::string FormatRobot(const RobotStatus& robot) {
  std::string text = fmt::format("{} in {}: {}{}{}{}\n", robot.session.robot, robot.session.site,
                                 SessionPhaseName(robot.session.phase), robot.alive ? ", connected" : ", not connected",
                                 robot.session.localise_only ? ", only localised" : "",
                                 robot.session.fragment ? ", not joined with the map" : "");
  if (!robot.session.status.ok()) {
    text += fmt::format("  {}: {}\n", StatusCodeName(robot.session.status.code), robot.session.status.message);
  }
  if (robot.pose.reason != PoseReason::kWaiting) {
    const Pose2& p = robot.pose.T_map_robot;
    text += fmt::format("  pose {:.3f} {:.3f} {:.4f} at {}, {}, score {:.2f}\n", p.x, p.y, p.theta,
                        FormatStamp(robot.pose.stamp), PoseReasonName(robot.pose.reason), robot.pose.score);
  }
  // What is not sure enough to be used is only in the JSON.
  for (const LearnedValue& learned : robot.learned) {
    if (learned.applied) text += fmt::format("  {}\n", TextOf(learned));
  }
  for (const Ledger& ledger : robot.ledgers) {
    text += fmt::format(
        "  {}: received {}, used {} ({} keyframes), dropped {}, waiting {}; odometry {} (dropped {}, merged {}); "
        "latency p50 {:.1f} ms, p99 {:.1f} ms\n",
        ledger.sensor, ledger.received, ledger.used, ledger.keyframes, ledger.dropped_total(), ledger.waiting,
        ledger.odometry_received, ledger.odometry_dropped, ledger.odometry_merged, ledger.latency_p50_ms,
        ledger.latency_p99_ms);
    for (int i = 0; i < kDropReasonCount; ++i) {
      const std::uint64_t count = ledger.dropped[static_cast<std::size_t>(i)];
      if (count > 0) text += fmt::format("    dropped {}: {}\n", DropReasonName(static_cast<DropReason>(i)), count);
    }
  }
  return text;
}

std::string FormatLoad(const ServerLoad& now, const ServerLoad* before) {
  if (now.up_s <= 0.0) return "";
  // Not after a restart. Without a newer measurement there is nothing to compare.
  const bool compares = before != nullptr && before->up_s <= now.up_s && before->processor_s <= now.processor_s;
  const ServerLoad since = compares ? *before : ServerLoad{};
  std::string text = "server: up " + FormatUpTime(now.up_s) + ", ";
  if (now.up_s > since.up_s) {
    text += fmt::format("{:.0f} % of a processor, ",
                        100.0 * (now.processor_s - since.processor_s) / (now.up_s - since.up_s));
  }
  text += fmt::format("{:.0f} MiB of memory, {} values queued", static_cast<double>(now.memory_bytes) / kMib,
                      now.inbound_waiting + now.outbound_waiting);
  if (now.strand_wait_p99_ms > 0.0) {
    text +=
        fmt::format(", a thread free after {:.1f} ms (p99 {:.1f} ms)", now.strand_wait_p50_ms, now.strand_wait_p99_ms);
  }
  if (now.stores) {
    text += fmt::format("; stored after {:.0f} ms (p99 {:.0f} ms), {:.0f} MiB on the disk", now.stored_after_p50_ms,
                        now.stored_after_p99_ms, static_cast<double>(now.store_bytes) / kMib);
  }
  return text + "\n";
}

std::string FormatRefusals(const Refusals& refused) {
  if (refused == Refusals{}) return "";
  return fmt::format(
      "DDS Security {}; refused since the start: {} peers, {} endpoints, {} samples, {} commands, {} "
      "datagrams, {} over a limit\n",
      refused.secure ? "on" : "off", refused.peers, refused.endpoints, refused.samples, refused.commands,
      refused.datagrams, refused.over_limit);
}

std::size_t RobotsOffMap(const Ros2Report& report) {
  return static_cast<std::size_t>(
      std::ranges::count_if(report.namespaces, [](const Ros2Namespace& one) { return !one.on_map; }));
}

std::string FormatRos2Door(const Ros2Report& report, std::size_t problems) {
  const std::size_t off_map = RobotsOffMap(report);
  if (!report.door.enabled || (off_map == 0 && problems == 0)) return "";
  return fmt::format("ROS 2: {} of {} robots {} not on the map{}; see `cairn ros2 doctor`\n", off_map,
                     report.namespaces.size(), off_map == 1 ? "is" : "are",
                     problems == 0 ? "" : fmt::format(", {} problem{}", problems, problems == 1 ? "" : "s"));
}

std::string FormatMemoryNotes(std::span<const MapInfo> maps) {
  std::string text;
  for (const MapInfo& map : maps)
    if (!map.memory_note.empty()) text += "memory of site " + map.site + ": " + map.memory_note + "\n";
  return text;
}

std::string FormatMap(const MapInfo& map) {
  std::string text =
      fmt::format("{}: {} in {} of {} m, epoch {}, version {}, {}", map.site, Counted(map.tile_count, "tile"),
                  Counted(map.levels, "level"), map.resolution_m, map.epoch, map.version, Counted(map.robots, "robot"));
  if (map.memory_bytes > 0) text += fmt::format(", {:.1f} MiB of memory", static_cast<double>(map.memory_bytes) / kMib);
  text += "\n";
  if (!map.memory_note.empty()) text += "  memory: " + map.memory_note + "\n";
  if (map.tile_count > 0) {
    text +=
        fmt::format("  x {:.2f}..{:.2f} m, y {:.2f}..{:.2f} m\n", map.x_min_m, map.x_max_m, map.y_min_m, map.y_max_m);
  }
  for (const MapVersionInfo& version : map.versions) {
    // The note of the live map says that it is live.
    text += fmt::format("  {} version {}{}{}\n", version.enabled ? "*" : " ", version.version,
                        version.job > 0 ? fmt::format(" by job {}", version.job) : "",
                        version.note.empty() ? "" : ": " + version.note);
  }
  return text;
}

std::string FormatEdit(const MapEdit& edit) {
  std::string text = fmt::format("{}: {}", edit.id, MapEditKindName(edit.kind));
  if (edit.width_m > 0.0) text += fmt::format(", a line of {} m", edit.width_m);
  for (const Eigen::Vector2d& point : edit.points_map) text += fmt::format(" {:.2f},{:.2f}", point.x(), point.y());
  if (!edit.note.empty()) text += ": " + edit.note;
  return text + "\n";
}

std::string FormatTrajectoryError(const TrajectoryError& e) {
  return fmt::format(
      "{} poses over {:.1f} m ({} not comparable): ATE rmse {:.4f} m, mean {:.4f}, median {:.4f}, max {:.4f}, final "
      "{:.4f}; heading rmse {:.3f} deg, max {:.3f} deg\n",
      e.compared, e.way_m, e.skipped, e.rmse_m, e.mean_m, e.median_m, e.max_m, e.final_m, Degrees(e.rmse_rad),
      Degrees(e.max_rad));
}

std::string FormatCrispness(const std::vector<NamedCrispness>& rows) {
  std::size_t width = std::string_view("TRAJECTORY").size();
  for (const NamedCrispness& row : rows) width = std::max(width, row.name.size());
  std::string text = fmt::format("{:<{}}  ENTROPY  THICKNESS (mm)    POINTS    SCANS  LEFT OUT\n", "TRAJECTORY", width);
  for (const auto& [name, crispness] : rows) {
    text +=
        fmt::format("{:<{}}  {:>7.3f}  {:>14.1f}  {:>8}  {:>7}  {:>8}\n", name, width, crispness.map.mean_entropy,
                    1000.0 * crispness.map.thickness_m, crispness.points, crispness.scans, crispness.scans_left_out);
  }
  return text;
}

std::string FormatLogReport(const LogReport& r) {
  std::string text = "scans     " + FormatStamps(r.scans) + "\n";
  text += "odometry  " + FormatStamps(r.odometry) + "\n";
  std::string beams;
  std::size_t listed = 0;
  for (const auto& [count, scans] : r.beam_counts) {
    if (++listed > 5) {
      beams += ", ...";
      break;
    }
    beams += fmt::format("{}{} x {}", beams.empty() ? "" : ", ", scans, count);
  }
  text += fmt::format(
      "beams     {}; field of view {:.1f} deg, step {:.3f} deg, up to {:.2f} m, laser at {:.3f} {:.3f} {:.1f} deg\n",
      beams.empty() ? "none" : beams, Degrees(r.field_of_view_rad), Degrees(r.angle_step_rad), r.range_max_m,
      r.T_robot_laser.x, r.T_robot_laser.y, Degrees(r.T_robot_laser.theta));
  text += fmt::format("ranges    {:.1f} % hit, {:.1f} % nothing there, {:.1f} % invalid\n", 100 * r.hit_share,
                      100 * r.no_return_share, 100 * r.invalid_share);
  text += fmt::format("motion    {:.1f} m, {:.0f} deg turned, fastest {:.2f} m/s\n", r.way_m, Degrees(r.turned_rad),
                      r.fastest_m_s);
  text += fmt::format("{:<10}{} unreadable, {} of other kinds\n", std::string(r.summary.entry) + "s",
                      r.summary.complaint_count, r.summary.ignored);
  for (const std::string& line : r.summary.notes) text += "note      " + line + "\n";
  for (const LogComplaint& complaint : r.summary.complaints) {
    text += fmt::format("{} {}: {}\n", r.summary.entry, complaint.line, complaint.reason);
  }
  for (const Finding& finding : r.findings) {
    text += fmt::format("{}: {}: {}\n", finding.error ? "error" : "warning", finding.what, finding.advice);
  }
  return text + (r.has_errors() ? "not clean: scans will be lost or badly placed\n" : "good for mapping\n");
}

}  // namespace cairn::client
