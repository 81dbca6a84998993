#include "client/web/web_json.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/lib/ros2_findings.h"

namespace cairn::web {
namespace {

using Json = nlohmann::json;

// Names from the wire may hold bytes that are not UTF-8.
std::string Text(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

double Rounded(double value) {
  return std::isfinite(value) ? std::round(value * 1e4) / 1e4 : 0.0;
}

// Half axes and direction of the ellipse that holds the position with 95 %: 2.448 is the root of the chi-square
// distribution's quantile with two degrees of freedom.
Json EllipseJson(const Eigen::Matrix2d& covariance) {
  constexpr double kScale = 2.4477;
  if (!covariance.allFinite()) return nullptr;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance);
  const Eigen::Vector2d axes = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt() * kScale;
  const Eigen::Vector2d longest = solver.eigenvectors().col(1);
  return {Rounded(axes[1]), Rounded(axes[0]), Rounded(std::atan2(longest.y(), longest.x()))};
}

Json PoseJson(const PoseReport& pose) {
  return {{"x", Rounded(pose.T_map_robot.x)},
          {"y", Rounded(pose.T_map_robot.y)},
          {"theta", Rounded(pose.T_map_robot.theta)},
          {"ellipse", EllipseJson(pose.covariance.topLeftCorner<2, 2>())},
          {"sd_theta", Rounded(std::sqrt(std::max(0.0, pose.covariance(2, 2))))},
          {"localized", pose.localized},
          {"reason", PoseReasonName(pose.reason)},
          {"score", Rounded(pose.score)}};
}

Json LedgerJson(const Ledger& ledger) {
  Json dropped = Json::object();
  for (int i = 0; i < kDropReasonCount; ++i) {
    const std::uint64_t count = ledger.dropped[static_cast<std::size_t>(i)];
    if (count > 0) dropped[std::string(DropReasonName(static_cast<DropReason>(i)))] = count;
  }
  return {{"sensor", ledger.sensor},       {"received", ledger.received},  {"used", ledger.used},
          {"keyframes", ledger.keyframes}, {"waiting", ledger.waiting},    {"dropped", dropped},
          {"p50", ledger.latency_p50_ms},  {"p99", ledger.latency_p99_ms}, {"odometry", ledger.odometry_received}};
}

Json RobotJson(const RobotStatus& robot) {
  Json ledgers = Json::array();
  for (const Ledger& ledger : robot.ledgers) ledgers.push_back(LedgerJson(ledger));
  const SessionState& session = robot.session;
  // The server says in a status that is OK that a robot is only localised; `mode` says the same.
  const bool said_by_mode = session.localise_only && session.status.ok();
  Json json = {{"name", session.robot},  {"phase", SessionPhaseName(session.phase)},
               {"stale", session.stale}, {"note", said_by_mode ? std::string() : session.status.message},
               {"alive", robot.alive},   {"fragment", session.fragment},
               {"sensors", ledgers},     {"mode", session.localise_only ? "localise" : "map"}};
  json["pose"] = robot.pose.reason == PoseReason::kWaiting ? Json() : PoseJson(robot.pose);
  return json;
}

Json MapJson(const MapInfo& map) {
  Json versions = Json::array();
  for (const MapVersionInfo& version : map.versions) {
    versions.push_back({{"version", version.version},
                        {"enabled", version.enabled},
                        {"job", std::to_string(version.job)},
                        {"note", version.note}});
  }
  return {{"resolution", map.resolution_m},
          {"epoch", map.epoch},
          {"version", map.version},
          {"levels", map.levels},
          {"tiles", map.tile_count},
          {"bounds", {map.x_min_m, map.y_min_m, map.x_max_m, map.y_max_m}},
          {"enabled", map.enabled_version},
          {"versions", versions},
          {"edits", std::to_string(map.edits_version)}};
}

Json ToJson(const Job& job) {
  return {{"id", std::to_string(job.id)},
          {"kind", JobKindName(job.kind)},
          {"state", JobStateName(job.state)},
          {"final", IsFinal(job.state)},
          {"progress", Rounded(job.progress)},
          {"cost_before", job.cost_before},
          {"cost_after", job.cost_after},
          {"version", job.map_version},
          {"submitted_ms", job.submitted / 1000000},
          {"ended_ms", job.ended / 1000000},
          {"message", job.message}};
}

Json JobsJson(const std::vector<Job>& jobs, const std::string& site) {
  constexpr std::size_t kMost = 20;
  std::vector<const Job*> of_site;
  for (const Job& job : jobs)
    if (job.site == site) of_site.push_back(&job);
  std::stable_sort(of_site.begin(), of_site.end(),
                   [](const Job* a, const Job* b) { return a->submitted > b->submitted; });
  if (of_site.size() > kMost) of_site.resize(kMost);
  Json json = Json::array();
  for (const Job* job : of_site) json.push_back(ToJson(*job));
  return json;
}

}  // namespace

std::string StateJson(const ServerView& view, const std::string& site, bool commands) {
  const Refusals& refused = view.status.refused;
  Json json = {{"connected", view.connected},
               // Only where it is old news: else the state would change with each answer.
               {"answered_ms", view.connected ? 0 : view.answered_ms},
               {"version", view.version},
               {"degraded", view.status.degraded},
               {"refused",
                {{"secure", refused.secure},
                 {"peers", refused.peers},
                 {"endpoints", refused.endpoints},
                 {"samples", refused.samples},
                 {"commands", refused.commands},
                 {"datagrams", refused.datagrams},
                 {"over_limit", refused.over_limit}}},
               {"commands", commands},
               {"sites", view.Sites()}};
  if (site.empty()) return Text(json);
  json["site"] = site;
  const MapInfo* map = view.Map(site);
  json["map"] = map == nullptr ? Json() : MapJson(*map);
  std::map<std::string, Json> robots;  // By name, so that a list of them keeps its order.
  for (const RobotStatus& robot : view.status.robots) {
    if (robot.session.site == site) robots[robot.session.robot] = RobotJson(robot);
  }
  json["robots"] = Json::array();
  for (auto& [name, robot] : robots) json["robots"].push_back(std::move(robot));
  json["jobs"] = JobsJson(view.jobs, site);
  return Text(json);
}

std::string EditsJson(const std::vector<MapEdit>& edits) {
  Json json = Json::array();
  for (const MapEdit& edit : edits) {
    Json points = Json::array();
    for (const Eigen::Vector2d& point : edit.points_map) points.push_back({point.x(), point.y()});
    json.push_back({{"id", std::to_string(edit.id)},
                    {"kind", MapEditKindName(edit.kind)},
                    {"points", std::move(points)},
                    {"width", edit.width_m},
                    {"note", edit.note},
                    {"made_ms", edit.made / 1000000}});
  }
  return Text(json);
}

Result<MapEdit> EditFromJson(const nlohmann::json& json) {
  const auto invalid = [](const char* why) { return Fail(StatusCode::kInvalidArgument, why); };
  MapEdit edit;
  const auto text = [&json](const char* name) {
    const auto found = json.find(name);
    return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  const std::string kind = text("kind");
  int number = 0;
  while (number < kMapEditKindCount && kind != MapEditKindName(static_cast<MapEditKind>(number))) ++number;
  if (number == kMapEditKindCount) return invalid("`kind` must be free, unknown, occupied, keep_out or origin");
  edit.kind = static_cast<MapEditKind>(number);
  const auto points = json.find("points");
  if (points == json.end() || !points->is_array() || points->size() > kMostEditPoints)
    return invalid("`points` must be a list of at most 64 points");
  for (const auto& point : *points) {
    if (!point.is_array() || point.size() != 2 || !point[0].is_number() || !point[1].is_number())
      return invalid("a point must be two numbers");
    edit.points_map.emplace_back(point[0].get<double>(), point[1].get<double>());
  }
  const auto width = json.find("width");
  if (width != json.end() && !width->is_number()) return invalid("`width` must be a number");
  if (width != json.end()) edit.width_m = width->get<double>();
  const auto note = json.find("note");
  if (note != json.end() && !note->is_string()) return invalid("`note` must be a text");
  edit.note = text("note");
  if (auto valid = ValidateMapEdit(edit); !valid) return tl::unexpected(valid.error());
  return edit;
}

std::string TilesJson(const client::TileChanges& changes) {
  Json tiles = Json::array();
  for (const auto& change : changes.changed) {
    tiles.push_back({change.key.level, change.key.x, change.key.y, change.removed ? 0 : change.version});
  }
  return Text({{"whole", changes.whole}, {"tiles", tiles}});
}

std::string FlowJson(const Flow& flow, std::int64_t since_ms) {
  Json samples = Json::array();
  for (const FlowSample& sample : flow) {
    if (sample.time_ms <= since_ms) continue;
    samples.push_back({sample.time_ms, Rounded(sample.used_per_s), Rounded(sample.dropped_per_s),
                       Rounded(sample.latency_p50_ms), Rounded(sample.latency_p99_ms)});
  }
  return Text(samples);
}

std::string PathJson(const Trajectory& path, std::size_t most) {
  double length = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    length += (path[i].T_map_robot.translation() - path[i - 1].T_map_robot.translation()).norm();
  }
  const double apart = std::max(0.05, length / static_cast<double>(most - 1));
  Json points = Json::array();
  Eigen::Vector2d last = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Eigen::Vector2d here = path[i].T_map_robot.translation();
    if (i > 0 && i + 1 < path.size() && (here - last).norm() < apart) continue;
    last = here;
    points.push_back({Rounded(here.x()), Rounded(here.y())});
  }
  return Text({{"length", Rounded(length)}, {"poses", path.size()}, {"points", points}});
}

std::string LandmarksJson(const std::vector<LandmarkReport>& landmarks) {
  constexpr std::size_t kMost = 5000;
  Json json = Json::array();
  for (const LandmarkReport& landmark : landmarks) {
    if (json.size() >= kMost) break;
    json.push_back({Rounded(landmark.p_map.x()), Rounded(landmark.p_map.y()), landmark.corner, landmark.sightings});
  }
  return Text(json);
}

std::string JobJson(const Job& job) {
  return Text(ToJson(job));
}

std::string DoctorJson(const ServerView& view) {
  Json json = {{"ros2", nullptr}, {"strays", Json::array()}};
  for (const StrayStream& stray : view.strays)
    json["strays"].push_back({{"robot", stray.robot}, {"dropped", stray.dropped}, {"why", stray.why}});
  if (view.ros2 == nullptr) return Text(json);
  const client::Ros2Findings findings = client::FindingsOf(*view.ros2);
  Json namespaces = Json::array();
  for (const client::Ros2Findings::Namespace& one : findings.namespaces) {
    namespaces.push_back({{"name", one.name},
                          {"who", one.who},
                          {"on_map", one.on_map},
                          {"problems", one.problems},
                          {"topics", one.topics}});
  }
  json["ros2"] = {{"where", findings.where},
                  {"problems", findings.problems},
                  {"advice", findings.advice},
                  {"namespaces", namespaces}};
  return Text(json);
}

}  // namespace cairn::web
