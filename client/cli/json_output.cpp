#include "client/cli/json_output.h"

#include <string>

namespace cairn {
namespace {

nlohmann::json DropsToJson(const std::array<std::uint64_t, kDropReasonCount>& dropped) {
  nlohmann::json drops = nlohmann::json::object();
  for (int i = 0; i < kDropReasonCount; ++i) {
    if (const auto count = dropped[static_cast<std::size_t>(i)]; count > 0) {
      drops[std::string(DropReasonName(static_cast<DropReason>(i)))] = count;
    }
  }
  return drops;
}

}  // namespace

void to_json(nlohmann::json& json, const Status& status) {
  json = {{"code", StatusCodeName(status.code)}, {"message", status.message}};
  if (!status.request.empty()) json["request"] = status.request;
}

void to_json(nlohmann::json& json, const Pose2& pose) {
  json = {{"x", pose.x}, {"y", pose.y}, {"theta", pose.theta}};
}

void to_json(nlohmann::json& json, const PoseReport& pose) {
  nlohmann::json covariance = nlohmann::json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) covariance.push_back(pose.covariance(row, column));
  }
  json = {{"robot", pose.robot},           {"site", pose.site},
          {"stamp", pose.stamp},           {"scan_sequence", pose.scan_sequence},
          {"pose", pose.T_map_robot},      {"covariance", covariance},
          {"T_map_odom", pose.T_map_odom}, {"localized", pose.localized},
          {"score", pose.score},           {"reason", PoseReasonName(pose.reason)},
          {"map_epoch", pose.map_epoch}};
}

void to_json(nlohmann::json& json, const Ledger& ledger) {
  json = {{"robot", ledger.robot},
          {"sensor", ledger.sensor},
          {"site", ledger.site},
          {"received", ledger.received},
          {"used", ledger.used},
          {"keyframes", ledger.keyframes},
          {"waiting", ledger.waiting},
          {"dropped", DropsToJson(ledger.dropped)},
          {"dropped_total", ledger.dropped_total()},
          {"odometry_received", ledger.odometry_received},
          {"odometry_dropped", ledger.odometry_dropped},
          {"odometry_merged", ledger.odometry_merged},
          {"last_sequence", ledger.last_sequence},
          {"settled_through", ledger.settled_through},
          {"durable_through", ledger.durable_through},
          {"last_stamp", ledger.last_stamp},
          {"latency_p50_ms", ledger.latency_p50_ms},
          {"latency_p99_ms", ledger.latency_p99_ms}};
}

void to_json(nlohmann::json& json, const LearnedValue& learned) {
  json = {{"name", learned.name},
          {"unit", learned.unit},
          {"value", learned.value},
          {"sigma", learned.sigma},
          {"applied", learned.applied}};
}

void to_json(nlohmann::json& json, const RobotStatus& robot) {
  json = {{"robot", robot.session.robot},
          {"site", robot.session.site},
          {"phase", SessionPhaseName(robot.session.phase)},
          {"fragment", robot.session.fragment},
          {"localise_only", robot.session.localise_only},
          {"stale", robot.session.stale},
          {"status", robot.session.status},
          {"alive", robot.alive},
          {"pose", robot.pose},
          {"learned", robot.learned},
          {"ledgers", robot.ledgers}};
}

void to_json(nlohmann::json& json, const MapVersionInfo& version) {
  json = {{"version", version.version}, {"enabled", version.enabled}, {"job", version.job}, {"note", version.note}};
}

void to_json(nlohmann::json& json, const MapInfo& map) {
  json = {
      {"site", map.site},
      {"resolution_m", map.resolution_m},
      {"epoch", map.epoch},
      {"version", map.version},
      {"levels", map.levels},
      {"tile_count", map.tile_count},
      {"bounds_m", {{"x_min", map.x_min_m}, {"y_min", map.y_min_m}, {"x_max", map.x_max_m}, {"y_max", map.y_max_m}}},
      {"robots", map.robots},
      {"enabled_version", map.enabled_version},
      {"versions", map.versions},
      {"edits_version", map.edits_version},
      {"memory_bytes", map.memory_bytes},
      {"memory_note", map.memory_note}};
}

void to_json(nlohmann::json& json, const MapEdit& edit) {
  std::vector<std::array<double, 2>> points;
  for (const Eigen::Vector2d& point : edit.points_map) points.push_back({point.x(), point.y()});
  json = {{"id", edit.id},      {"kind", MapEditKindName(edit.kind)},
          {"points_m", points}, {"width_m", edit.width_m},
          {"note", edit.note},  {"made", edit.made}};
}

void to_json(nlohmann::json& json, const SavedSite& saved) {
  json = {{"name", saved.name}, {"site", saved.site}, {"bytes", saved.bytes}, {"saved", saved.saved}};
}

void to_json(nlohmann::json& json, const Refusals& refused) {
  json = {{"secure", refused.secure},        {"peers", refused.peers},       {"endpoints", refused.endpoints},
          {"samples", refused.samples},      {"commands", refused.commands}, {"datagrams", refused.datagrams},
          {"over_limit", refused.over_limit}};
}

void to_json(nlohmann::json& json, const PoseHypothesis& hypothesis) {
  json = {{"stamp", hypothesis.stamp}, {"T_map_robot", hypothesis.T_map_robot}, {"weight", hypothesis.weight}};
}

void to_json(nlohmann::json& json, const ServerLoad& load) {
  json = {{"up_s", load.up_s},
          {"processor_s", load.processor_s},
          {"memory_bytes", load.memory_bytes},
          {"inbound_waiting", load.inbound_waiting},
          {"outbound_waiting", load.outbound_waiting},
          {"strand_wait_p50_ms", load.strand_wait_p50_ms},
          {"strand_wait_p99_ms", load.strand_wait_p99_ms},
          {"stores", load.stores},
          {"commits", load.commits},
          {"failed_commits", load.failed_commits},
          {"store_bytes", load.store_bytes},
          {"stored_after_p50_ms", load.stored_after_p50_ms},
          {"stored_after_p99_ms", load.stored_after_p99_ms}};
}

void to_json(nlohmann::json& json, const Ros2Topic& topic) {
  json = {{"name", topic.name},
          {"type", topic.type},
          {"publishers", topic.publishers},
          {"reliable", topic.reliable},
          {"transient_local", topic.transient_local},
          {"rate_hz", topic.rate_hz},
          {"received", topic.received},
          {"refused", topic.refused}};
}

void to_json(nlohmann::json& json, const Ros2Namespace& one) {
  json = {{"name", one.name},     {"robot", one.robot},       {"site", one.site},
          {"on_map", one.on_map}, {"problems", one.problems}, {"topics", one.topics}};
}

void to_json(nlohmann::json& json, const Ros2Report& report) {
  json = {{"domain", report.door.domain},     {"malformed", report.door.malformed},
          {"overflow", report.door.overflow}, {"unpublished", report.door.unpublished},
          {"problems", report.door.problems}, {"namespaces", report.namespaces}};
}

void to_json(nlohmann::json& json, const Tile& tile) {
  json = {{"level", tile.key.level},   {"x", tile.key.x},
          {"y", tile.key.y},           {"epoch", tile.epoch},
          {"version", tile.version},   {"encoding", tile.encoding == TileEncoding::kPng ? "png" : "raw"},
          {"bytes", tile.bytes.size()}};
}

void to_json(nlohmann::json& json, const Job& job) {
  json = {{"id", job.id},
          {"site", job.site},
          {"kind", JobKindName(job.kind)},
          {"state", JobStateName(job.state)},
          {"progress", job.progress},
          {"cost_before", job.cost_before},
          {"cost_after", job.cost_after},
          {"map_version", job.map_version},
          {"submitted", job.submitted},
          {"started", job.started},
          {"ended", job.ended},
          {"message", job.message}};
  if (job.kind != JobKind::kRelocalise) return;
  json["robot"] = job.robot;
  json["places"] = job.places;
  json["ambiguity"] = Ambiguity(job);
}

void to_json(nlohmann::json& json, const LogComplaint& complaint) {
  json = {{"line", complaint.line}, {"reason", complaint.reason}};
}

namespace client {

void to_json(nlohmann::json& json, const ScanAccount& account) {
  json = {{"sent", account.sent},
          {"used", account.used},
          {"keyframes", account.keyframes},
          {"waiting", account.waiting},
          {"dropped", DropsToJson(account.dropped)},
          {"dropped_total", account.dropped_total()},
          {"unexplained", account.unexplained()}};
}

void to_json(nlohmann::json& json, const TrajectoryError& error) {
  json = {{"compared", error.compared}, {"skipped", error.skipped}, {"way_m", error.way_m},
          {"ate_rmse_m", error.rmse_m}, {"mean_m", error.mean_m},   {"median_m", error.median_m},
          {"max_m", error.max_m},       {"final_m", error.final_m}, {"rmse_rad", error.rmse_rad},
          {"max_rad", error.max_rad}};
}

void to_json(nlohmann::json& json, const NamedCrispness& row) {
  const TrajectoryCrispness& crispness = row.crispness;
  json = {{"trajectory", row.name},
          {"mean_map_entropy", crispness.map.mean_entropy},
          {"thickness_m", crispness.map.thickness_m},
          {"places", crispness.map.places},
          {"points", crispness.points},
          {"scans", crispness.scans},
          {"scans_left_out", crispness.scans_left_out}};
}

void to_json(nlohmann::json& json, const StampSummary& stamps) {
  json = {{"count", stamps.count},
          {"duration_s", stamps.duration_s},
          {"rate_hz", stamps.rate_hz},
          {"repeated", stamps.repeated},
          {"went_back", stamps.went_back},
          {"gaps", stamps.gaps},
          {"period_p99_s", stamps.period_p99_s},
          {"longest_gap_s", stamps.longest_gap_s}};
}

void to_json(nlohmann::json& json, const Finding& finding) {
  json = {{"error", finding.error}, {"what", finding.what}, {"advice", finding.advice}};
}

void to_json(nlohmann::json& json, const LogReport& report) {
  nlohmann::json beams = nlohmann::json::object();
  for (const auto& [count, scans] : report.beam_counts) beams[std::to_string(count)] = scans;
  json = {{"good", !report.has_errors()},
          {"scans", report.scans},
          {"odometry", report.odometry},
          {"ignored", report.summary.ignored},
          {"beam_counts", beams},
          {"field_of_view_rad", report.field_of_view_rad},
          {"angle_step_rad", report.angle_step_rad},
          {"range_max_m", report.range_max_m},
          {"T_robot_laser", report.T_robot_laser},
          {"hit_share", report.hit_share},
          {"no_return_share", report.no_return_share},
          {"invalid_share", report.invalid_share},
          {"way_m", report.way_m},
          {"turned_rad", report.turned_rad},
          {"fastest_m_s", report.fastest_m_s},
          {"refused", report.refused},
          {"notes", report.summary.notes},
          {"complaint_count", report.summary.complaint_count},
          {"complaints", report.summary.complaints},
          {"findings", report.findings}};
}

}  // namespace client
}  // namespace cairn
