#include <cstring>
#include <vector>

#include "tests/common/wire/sample_values.h"

namespace cairn::wire {
namespace {

// Bits, so that NaN and -0 are told apart.
bool Eq(double a, double b) {
  return std::memcmp(&a, &b, sizeof(a)) == 0;
}
bool Eq(const Pose2& a, const Pose2& b) {
  return Eq(a.x, b.x) && Eq(a.y, b.y) && Eq(a.theta, b.theta);
}
template <typename Matrix>
bool EqMatrix(const Matrix& a, const Matrix& b) {
  return std::memcmp(a.data(), b.data(), sizeof(double) * static_cast<std::size_t>(a.size())) == 0;
}
bool Eq(const Status& a, const Status& b) {
  return a.code == b.code && a.message == b.message;
}
bool Eq(const Tile& a, const Tile& b) {
  return a.key == b.key && a.epoch == b.epoch && a.version == b.version && a.encoding == b.encoding &&
         a.bytes == b.bytes;
}
bool Eq(const StreamId& a, const StreamId& b) {
  return a.robot_id == b.robot_id && a.sensor_id == b.sensor_id && a.session == b.session;
}
bool Eq(const StampedPose& a, const StampedPose& b) {
  return a.stamp == b.stamp && Eq(a.T_map_robot, b.T_map_robot);
}
bool Eq(const LandmarkReport& a, const LandmarkReport& b) {
  return a.id == b.id && a.robot == b.robot && a.corner == b.corner && EqMatrix(a.p_map, b.p_map) &&
         Eq(a.direction_rad, b.direction_rad) && EqMatrix(a.covariance, b.covariance) && a.sightings == b.sightings;
}
bool Eq(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return EqMatrix(a, b);
}
bool Eq(const ServerLoad& a, const ServerLoad& b) {
  return Eq(a.up_s, b.up_s) && Eq(a.processor_s, b.processor_s) && a.memory_bytes == b.memory_bytes &&
         a.inbound_waiting == b.inbound_waiting && a.outbound_waiting == b.outbound_waiting &&
         Eq(a.strand_wait_p50_ms, b.strand_wait_p50_ms) && Eq(a.strand_wait_p99_ms, b.strand_wait_p99_ms) &&
         a.stores == b.stores && a.commits == b.commits && a.failed_commits == b.failed_commits &&
         a.store_bytes == b.store_bytes && Eq(a.stored_after_p50_ms, b.stored_after_p50_ms) &&
         Eq(a.stored_after_p99_ms, b.stored_after_p99_ms);
}
bool Eq(const MapVersionInfo& a, const MapVersionInfo& b) {
  return a.version == b.version && a.enabled == b.enabled && a.job == b.job && a.note == b.note;
}
template <typename T, typename Equal>
bool EqList(const std::vector<T>& a, const std::vector<T>& b, Equal equal) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!equal(a[i], b[i])) return false;
  }
  return true;
}
bool Eq(const MapEdit& a, const MapEdit& b) {
  return a.id == b.id && a.kind == b.kind && Eq(a.width_m, b.width_m) && a.note == b.note && a.made == b.made &&
         EqList(a.points_map, b.points_map, [](const auto& p, const auto& q) { return Eq(p, q); });
}

}  // namespace

bool Same(const SessionRequest& a, const SessionRequest& b) {
  return a.robot == b.robot && a.site == b.site && a.sensors == b.sensors && a.client == b.client &&
         a.session == b.session && a.started == b.started && a.has_start == b.has_start &&
         Eq(a.T_map_robot_start, b.T_map_robot_start) && a.end == b.end && a.map_frame == b.map_frame;
}
bool Same(const SessionState& a, const SessionState& b) {
  return a.robot_id == b.robot_id && a.client == b.client && a.robot == b.robot && a.site == b.site &&
         a.phase == b.phase && Eq(a.status, b.status) && a.session == b.session && a.durable == b.durable &&
         a.localise_only == b.localise_only && a.fragment == b.fragment && a.stale == b.stale &&
         a.generation == b.generation && a.map_frame == b.map_frame;
}
bool Same(const SessionRefusal& a, const SessionRefusal& b) {
  return Same(a.state, b.state);
}
bool Same(const ScanSample& a, const ScanSample& b) {
  const Scan& s = a.scan;
  const Scan& t = b.scan;
  return Eq(a.stream, b.stream) && s.sequence == t.sequence && s.stamp == t.stamp &&
         Eq(s.angle_first_rad, t.angle_first_rad) && Eq(s.angle_step_rad, t.angle_step_rad) &&
         Eq(s.range_min_m, t.range_min_m) && Eq(s.range_max_m, t.range_max_m) && Eq(s.beam_period_s, t.beam_period_s) &&
         Eq(s.tilt_rad, t.tilt_rad) && Eq(s.T_robot_laser, t.T_robot_laser) && s.ranges_m.size() == t.ranges_m.size() &&
         (s.ranges_m.empty() || std::memcmp(s.ranges_m.data(), t.ranges_m.data(), s.ranges_m.size() * 4) == 0);
}
bool Same(const OdometrySample& a, const OdometrySample& b) {
  return Eq(a.stream, b.stream) && a.odometry.sequence == b.odometry.sequence && a.odometry.stamp == b.odometry.stamp &&
         Eq(a.odometry.T_odom_robot, b.odometry.T_odom_robot);
}
bool Same(const PoseReport& a, const PoseReport& b) {
  return a.robot_id == b.robot_id && a.robot == b.robot && a.site == b.site && a.stamp == b.stamp &&
         a.session == b.session && a.scan_sequence == b.scan_sequence && Eq(a.T_map_robot, b.T_map_robot) &&
         EqMatrix(a.covariance, b.covariance) && Eq(a.T_map_odom, b.T_map_odom) && a.localized == b.localized &&
         Eq(a.score, b.score) && a.reason == b.reason && a.map_epoch == b.map_epoch && a.generation == b.generation;
}
bool Same(const Ledger& a, const Ledger& b) {
  return a.robot_id == b.robot_id && a.sensor_id == b.sensor_id && a.robot == b.robot && a.sensor == b.sensor &&
         a.site == b.site && a.received == b.received && a.used == b.used && a.keyframes == b.keyframes &&
         a.waiting == b.waiting && a.dropped == b.dropped && a.odometry_received == b.odometry_received &&
         a.odometry_dropped == b.odometry_dropped && a.odometry_merged == b.odometry_merged &&
         a.last_sequence == b.last_sequence && a.settled_through == b.settled_through &&
         a.durable_through == b.durable_through && a.last_stamp == b.last_stamp && a.session == b.session &&
         a.generation == b.generation && Eq(a.latency_p50_ms, b.latency_p50_ms) &&
         Eq(a.latency_p99_ms, b.latency_p99_ms);
}
bool Same(const MapInfo& a, const MapInfo& b) {
  return a.site_id == b.site_id && a.site == b.site && Eq(a.resolution_m, b.resolution_m) && a.epoch == b.epoch &&
         a.version == b.version && a.levels == b.levels && a.tile_count == b.tile_count && Eq(a.x_min_m, b.x_min_m) &&
         Eq(a.y_min_m, b.y_min_m) && Eq(a.x_max_m, b.x_max_m) && Eq(a.y_max_m, b.y_max_m) && a.robots == b.robots &&
         a.enabled_version == b.enabled_version && a.generation == b.generation && a.edits_version == b.edits_version &&
         a.memory_bytes == b.memory_bytes && a.memory_note == b.memory_note &&
         EqList(a.versions, b.versions, [](const auto& x, const auto& y) { return Eq(x, y); });
}
bool Same(const TileSample& a, const TileSample& b) {
  return a.site_id == b.site_id && Eq(a.tile, b.tile) && a.deleted == b.deleted && a.generation == b.generation;
}
bool Same(const Job& a, const Job& b) {
  const auto same_place = [](const PoseHypothesis& x, const PoseHypothesis& y) {
    return x.stamp == y.stamp && Eq(x.T_map_robot, y.T_map_robot) && Eq(x.weight, y.weight);
  };
  return a.id == b.id && a.site == b.site && a.kind == b.kind && a.state == b.state && Eq(a.progress, b.progress) &&
         Eq(a.cost_before, b.cost_before) && Eq(a.cost_after, b.cost_after) && a.map_version == b.map_version &&
         a.submitted == b.submitted && a.started == b.started && a.ended == b.ended && a.message == b.message &&
         a.generation == b.generation && a.robot == b.robot && EqList(a.places, b.places, same_place);
}
bool Same(const Request& a, const Request& b) {
  return a.client == b.client && a.sequence == b.sequence && a.kind == b.kind && a.site == b.site &&
         a.robot == b.robot && a.latest == b.latest && a.stamp == b.stamp && a.smoothed == b.smoothed &&
         Eq(a.area.x_min_m, b.area.x_min_m) && Eq(a.area.y_min_m, b.area.y_min_m) &&
         Eq(a.area.x_max_m, b.area.x_max_m) && Eq(a.area.y_max_m, b.area.y_max_m) && a.level == b.level &&
         a.since_epoch == b.since_epoch && a.since_version == b.since_version &&
         a.since_generation == b.since_generation && a.job == b.job && a.job_kind == b.job_kind &&
         a.enable == b.enable && a.map_version == b.map_version && a.saved == b.saved &&
         a.T_map_robot.has_value() == b.T_map_robot.has_value() &&
         (!a.T_map_robot || Eq(*a.T_map_robot, *b.T_map_robot)) && Eq(a.edit, b.edit) &&
         a.disagreement == b.disagreement;
}
bool Same(const Reply& a, const Reply& b) {
  const auto same = [](const auto& x, const auto& y) { return Same(x, y); };
  const auto eq = [](const auto& x, const auto& y) { return Eq(x, y); };
  const auto same_robot = [&](const RobotStatus& x, const RobotStatus& y) {
    return Same(x.session, y.session) && x.alive == y.alive && Same(x.pose, y.pose) &&
           EqList(x.ledgers, y.ledgers, same) && x.learned == y.learned;
  };
  const auto same_door = [](const Ros2DoorState& x, const Ros2DoorState& y) {
    return x.enabled == y.enabled && x.domain == y.domain && x.malformed == y.malformed && x.overflow == y.overflow &&
           x.unpublished == y.unpublished && x.problems == y.problems;
  };
  const auto same_topic = [](const Ros2Topic& x, const Ros2Topic& y) {
    return x.name == y.name && x.type == y.type && x.publishers == y.publishers && x.reliable == y.reliable &&
           x.transient_local == y.transient_local && Eq(x.rate_hz, y.rate_hz) && x.received == y.received &&
           x.refused == y.refused;
  };
  const auto same_namespace = [&](const Ros2Namespace& x, const Ros2Namespace& y) {
    return x.name == y.name && x.robot == y.robot && x.site == y.site && x.on_map == y.on_map &&
           x.problems == y.problems && EqList(x.topics, y.topics, same_topic);
  };
  const auto same_hypothesis = [](const PoseHypothesis& x, const PoseHypothesis& y) {
    return x.stamp == y.stamp && Eq(x.T_map_robot, y.T_map_robot) && Eq(x.weight, y.weight);
  };
  return a.client == b.client && a.sequence == b.sequence && a.part == b.part && a.last == b.last &&
         Eq(a.status, b.status) && a.map_epoch == b.map_epoch && a.map_version == b.map_version &&
         a.generation == b.generation && EqList(a.poses, b.poses, same) && EqList(a.path, b.path, eq) &&
         EqList(a.tiles, b.tiles, eq) && EqList(a.landmarks, b.landmarks, eq) && EqList(a.maps, b.maps, same) &&
         EqList(a.robots, b.robots, same_robot) && EqList(a.jobs, b.jobs, same) && EqList(a.ros2, b.ros2, same_door) &&
         EqList(a.ros2_namespaces, b.ros2_namespaces, same_namespace) && a.server_version == b.server_version &&
         EqList(a.edits, b.edits, eq) && a.refused == b.refused && EqList(a.load, b.load, eq) &&
         EqList(a.hypotheses, b.hypotheses, same_hypothesis) &&
         EqList(a.saved, b.saved, [](const SavedSite& x, const SavedSite& y) {
           return x.name == y.name && x.site == y.site && x.bytes == y.bytes && x.saved == y.saved;
         });
}

}  // namespace cairn::wire
