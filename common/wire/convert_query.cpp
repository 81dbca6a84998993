#include <utility>

#include "common/wire/convert.h"

namespace cairn::wire {
// Conversions of the parts of a reply. They are in the namespace cairn::wire, not in an unnamed one, so that
// the list conversions below find all overloads.
static v1::StampedPose ToWire(const StampedPose& value) {
  v1::StampedPose wire;
  wire.stamp_ns(value.stamp);
  wire.T_map_robot(ToWire(value.T_map_robot));
  return wire;
}
static StampedPose FromWire(v1::StampedPose&& wire) {
  return {wire.stamp_ns(), FromWire(wire.T_map_robot())};
}

static v1::TileRecord ToWire(const Tile& value) {
  v1::TileRecord wire;
  wire.level(value.key.level);
  wire.x(value.key.x);
  wire.y(value.key.y);
  wire.content(ContentToWire(value));
  return wire;
}
static Tile FromWire(v1::TileRecord&& wire) {
  Tile value;
  value.key = {wire.level(), wire.x(), wire.y()};
  ContentFromWire(std::move(wire.content()), value);
  return value;
}

static v1::Landmark ToWire(const LandmarkReport& value) {
  v1::Landmark wire;
  wire.id(value.id);
  wire.robot(value.robot);
  wire.corner(value.corner);
  wire.x_m(value.p_map.x());
  wire.y_m(value.p_map.y());
  wire.direction_rad(value.direction_rad);
  wire.covariance({value.covariance(0, 0), value.covariance(0, 1), value.covariance(1, 0), value.covariance(1, 1)});
  wire.sightings(value.sightings);
  return wire;
}
static LandmarkReport FromWire(v1::Landmark&& wire) {
  LandmarkReport value;
  value.id = wire.id();
  value.robot = std::move(wire.robot());
  value.corner = wire.corner();
  value.p_map = {wire.x_m(), wire.y_m()};
  value.direction_rad = wire.direction_rad();
  const auto& covariance = wire.covariance();
  value.covariance << covariance[0], covariance[1], covariance[2], covariance[3];
  value.sightings = wire.sightings();
  return value;
}

static v1::LearnedValue ToWire(const LearnedValue& value) {
  v1::LearnedValue wire;
  wire.name(value.name);
  wire.unit(value.unit);
  wire.value(value.value);
  wire.sigma(value.sigma);
  wire.applied(value.applied);
  return wire;
}
static LearnedValue FromWire(v1::LearnedValue&& wire) {
  return {std::move(wire.name()), std::move(wire.unit()), wire.value(), wire.sigma(), wire.applied()};
}

static v1::RobotStatus ToWire(const RobotStatus& value) {
  v1::RobotStatus wire;
  wire.session(ToWire(value.session));
  wire.alive(value.alive);
  wire.pose(ToWire(value.pose));
  for (const Ledger& ledger : value.ledgers) wire.ledgers().push_back(ToWire(ledger));
  for (const LearnedValue& learned : value.learned) wire.learned().push_back(ToWire(learned));
  return wire;
}
static RobotStatus FromWire(v1::RobotStatus&& wire) {
  RobotStatus value;
  value.session = FromWire(std::move(wire.session()));
  value.alive = wire.alive();
  value.pose = FromWire(std::move(wire.pose()));
  for (v1::Ledger& ledger : wire.ledgers()) value.ledgers.push_back(FromWire(std::move(ledger)));
  for (v1::LearnedValue& learned : wire.learned()) value.learned.push_back(FromWire(std::move(learned)));
  return value;
}

static v1::SavedSite ToWire(const SavedSite& value) {
  v1::SavedSite wire;
  wire.name(value.name);
  wire.site(value.site);
  wire.bytes(value.bytes);
  wire.saved_ns(value.saved);
  return wire;
}
static SavedSite FromWire(v1::SavedSite&& wire) {
  return {std::move(wire.name()), std::move(wire.site()), wire.bytes(), wire.saved_ns()};
}

static v1::Refusals ToWire(const Refusals& value) {
  v1::Refusals wire;
  wire.secure(value.secure);
  wire.peers(value.peers);
  wire.endpoints(value.endpoints);
  wire.samples(value.samples);
  wire.commands(value.commands);
  wire.datagrams(value.datagrams);
  wire.over_limit(value.over_limit);
  return wire;
}
static Refusals FromWire(v1::Refusals&& wire) {
  return {wire.secure(),   wire.peers(),     wire.endpoints(), wire.samples(),
          wire.commands(), wire.datagrams(), wire.over_limit()};
}

static v1::ServerLoad ToWire(const ServerLoad& value) {
  v1::ServerLoad wire;
  wire.up_s(value.up_s);
  wire.processor_s(value.processor_s);
  wire.memory_bytes(value.memory_bytes);
  wire.inbound_waiting(value.inbound_waiting);
  wire.outbound_waiting(value.outbound_waiting);
  wire.strand_wait_p50_ms(value.strand_wait_p50_ms);
  wire.strand_wait_p99_ms(value.strand_wait_p99_ms);
  wire.stores(value.stores);
  wire.commits(value.commits);
  wire.failed_commits(value.failed_commits);
  wire.store_bytes(value.store_bytes);
  wire.stored_after_p50_ms(value.stored_after_p50_ms);
  wire.stored_after_p99_ms(value.stored_after_p99_ms);
  return wire;
}
static ServerLoad FromWire(v1::ServerLoad&& wire) {
  return {.up_s = wire.up_s(),
          .processor_s = wire.processor_s(),
          .memory_bytes = wire.memory_bytes(),
          .inbound_waiting = wire.inbound_waiting(),
          .outbound_waiting = wire.outbound_waiting(),
          .strand_wait_p50_ms = wire.strand_wait_p50_ms(),
          .strand_wait_p99_ms = wire.strand_wait_p99_ms(),
          .stores = wire.stores(),
          .commits = wire.commits(),
          .failed_commits = wire.failed_commits(),
          .store_bytes = wire.store_bytes(),
          .stored_after_p50_ms = wire.stored_after_p50_ms(),
          .stored_after_p99_ms = wire.stored_after_p99_ms()};
}

static v1::Ros2Topic ToWire(const Ros2Topic& value) {
  v1::Ros2Topic wire;
  wire.name(value.name);
  wire.type_name(value.type);
  wire.publishers(value.publishers);
  wire.reliable(value.reliable);
  wire.transient_local(value.transient_local);
  wire.rate_hz(value.rate_hz);
  wire.received(value.received);
  wire.refused(value.refused);
  return wire;
}
static Ros2Topic FromWire(v1::Ros2Topic&& wire) {
  return {std::move(wire.name()), std::move(wire.type_name()),
          wire.publishers(),      wire.reliable(),
          wire.transient_local(), wire.rate_hz(),
          wire.received(),        wire.refused()};
}

static v1::Ros2Namespace ToWire(const Ros2Namespace& value) {
  v1::Ros2Namespace wire;
  wire.name(value.name);
  wire.robot(value.robot);
  wire.site(value.site);
  wire.on_map(value.on_map);
  wire.problems(value.problems);
  for (const Ros2Topic& topic : value.topics) wire.topics().push_back(ToWire(topic));
  return wire;
}
static Ros2Namespace FromWire(v1::Ros2Namespace&& wire) {
  Ros2Namespace value{std::move(wire.name()), std::move(wire.robot()),    std::move(wire.site()),
                      wire.on_map(),          std::move(wire.problems()), {}};
  for (v1::Ros2Topic& topic : wire.topics()) value.topics.push_back(FromWire(std::move(topic)));
  return value;
}

static v1::Ros2DoorState ToWire(const Ros2DoorState& value) {
  v1::Ros2DoorState wire;
  wire.enabled(value.enabled);
  wire.domain(value.domain);
  wire.malformed(value.malformed);
  wire.overflow(value.overflow);
  wire.unpublished(value.unpublished);
  wire.problems(value.problems);
  return wire;
}
static Ros2DoorState FromWire(v1::Ros2DoorState&& wire) {
  return {wire.enabled(),  wire.domain(),      wire.malformed(),
          wire.overflow(), wire.unpublished(), std::move(wire.problems())};
}

// Convert a list element by element, in both directions.
template <typename Wires, typename Values>
static void ListToWire(const Values& values, Wires& wires) {
  wires.reserve(values.size());
  for (const auto& value : values) wires.push_back(ToWire(value));
}
template <typename Wires, typename Values>
static void ListFromWire(Wires&& wires, Values& values) {
  values.reserve(wires.size());
  for (auto& wire : wires) values.push_back(FromWire(std::move(wire)));
}

v1::Request ToWire(const Request& value) {
  v1::Request wire;
  wire.client(value.client);
  wire.seq(value.sequence);
  wire.kind(static_cast<v1::RequestKind>(value.kind));
  wire.site(value.site);
  wire.robot(value.robot);
  wire.latest(value.latest);
  wire.stamp_ns(value.stamp);
  wire.smoothed(value.smoothed);
  wire.area().x_min_m(value.area.x_min_m);
  wire.area().y_min_m(value.area.y_min_m);
  wire.area().x_max_m(value.area.x_max_m);
  wire.area().y_max_m(value.area.y_max_m);
  wire.level(value.level);
  wire.since_generation(value.since_generation);
  wire.since_epoch(value.since_epoch);
  wire.since_version(value.since_version);
  wire.job(value.job);
  wire.job_kind(static_cast<v1::JobKind>(value.job_kind));
  wire.enable(value.enable);
  wire.map_version(value.map_version);
  wire.saved(value.saved);
  wire.has_pose(value.T_map_robot.has_value());
  wire.T_map_robot(ToWire(value.T_map_robot.value_or(Pose2{})));
  wire.edit(ToWire(value.edit));
  wire.disagreement(value.disagreement);
  return wire;
}

Request FromWire(v1::Request&& wire) {
  Request value;
  value.client = wire.client();
  value.sequence = wire.seq();
  value.kind = static_cast<RequestKind>(wire.kind());
  value.site = std::move(wire.site());
  value.robot = std::move(wire.robot());
  value.latest = wire.latest();
  value.stamp = wire.stamp_ns();
  value.smoothed = wire.smoothed();
  value.area = {wire.area().x_min_m(), wire.area().y_min_m(), wire.area().x_max_m(), wire.area().y_max_m()};
  value.level = wire.level();
  value.since_generation = wire.since_generation();
  value.since_epoch = wire.since_epoch();
  value.since_version = wire.since_version();
  value.job = wire.job();
  value.job_kind = static_cast<JobKind>(wire.job_kind());
  value.enable = wire.enable();
  value.map_version = wire.map_version();
  value.saved = std::move(wire.saved());
  if (wire.has_pose()) value.T_map_robot = FromWire(wire.T_map_robot());
  value.edit = FromWire(std::move(wire.edit()));
  value.disagreement = wire.disagreement();
  return value;
}

v1::Reply ToWire(const Reply& value) {
  v1::Reply wire;
  wire.client(value.client);
  wire.seq(value.sequence);
  wire.part(value.part);
  wire.last(value.last);
  wire.status(ToWire(value.status));
  wire.generation(value.generation);
  wire.map_epoch(value.map_epoch);
  wire.map_version(value.map_version);
  ListToWire(value.poses, wire.poses());
  ListToWire(value.path, wire.path());
  ListToWire(value.tiles, wire.tiles());
  ListToWire(value.landmarks, wire.landmarks());
  ListToWire(value.maps, wire.maps());
  ListToWire(value.robots, wire.robots());
  ListToWire(value.jobs, wire.jobs());
  ListToWire(value.saved, wire.saved());
  ListToWire(value.refused, wire.refused());
  ListToWire(value.load, wire.load());
  ListToWire(value.ros2, wire.ros2());
  ListToWire(value.ros2_namespaces, wire.ros2_namespaces());
  ListToWire(value.edits, wire.edits());
  ListToWire(value.hypotheses, wire.hypotheses());
  wire.server_version(value.server_version);
  return wire;
}

Reply FromWire(v1::Reply&& wire) {
  Reply value;
  value.client = wire.client();
  value.sequence = wire.seq();
  value.part = wire.part();
  value.last = wire.last();
  value.status = FromWire(std::move(wire.status()));
  value.generation = wire.generation();
  value.map_epoch = wire.map_epoch();
  value.map_version = wire.map_version();
  ListFromWire(wire.poses(), value.poses);
  ListFromWire(wire.path(), value.path);
  ListFromWire(wire.tiles(), value.tiles);
  ListFromWire(wire.landmarks(), value.landmarks);
  ListFromWire(wire.maps(), value.maps);
  ListFromWire(wire.robots(), value.robots);
  ListFromWire(wire.jobs(), value.jobs);
  ListFromWire(wire.saved(), value.saved);
  ListFromWire(wire.refused(), value.refused);
  ListFromWire(wire.load(), value.load);
  ListFromWire(wire.ros2(), value.ros2);
  ListFromWire(wire.ros2_namespaces(), value.ros2_namespaces);
  ListFromWire(wire.edits(), value.edits);
  ListFromWire(wire.hypotheses(), value.hypotheses);
  value.server_version = std::move(wire.server_version());
  return value;
}

}  // namespace cairn::wire
