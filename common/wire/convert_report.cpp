#include <algorithm>
#include <utility>

#include "common/wire/convert.h"

namespace cairn::wire {

v1::PoseReport ToWire(const PoseReport& value) {
  v1::PoseReport wire;
  wire.robot_id(value.robot_id);
  wire.generation(value.generation);
  wire.robot(value.robot);
  wire.site(value.site);
  wire.stamp_ns(value.stamp);
  wire.session(value.session);
  wire.scan_sequence(value.scan_sequence);
  wire.T_map_robot(ToWire(value.T_map_robot));
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) {
      wire.covariance()[static_cast<std::size_t>(3 * row + col)] = value.covariance(row, col);
    }
  }
  wire.T_map_odom(ToWire(value.T_map_odom));
  wire.localized(value.localized);
  wire.score(value.score);
  wire.reason(static_cast<v1::PoseReason>(value.reason));
  wire.map_epoch(value.map_epoch);
  return wire;
}

PoseReport FromWire(v1::PoseReport&& wire) {
  PoseReport value;
  value.robot_id = wire.robot_id();
  value.generation = wire.generation();
  value.robot = std::move(wire.robot());
  value.site = std::move(wire.site());
  value.stamp = wire.stamp_ns();
  value.session = wire.session();
  value.scan_sequence = wire.scan_sequence();
  value.T_map_robot = FromWire(wire.T_map_robot());
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) {
      value.covariance(row, col) = wire.covariance()[static_cast<std::size_t>(3 * row + col)];
    }
  }
  value.T_map_odom = FromWire(wire.T_map_odom());
  value.localized = wire.localized();
  value.score = wire.score();
  value.reason = static_cast<PoseReason>(wire.reason());
  value.map_epoch = wire.map_epoch();
  return value;
}

v1::PoseHypothesis ToWire(const PoseHypothesis& value) {
  v1::PoseHypothesis wire;
  wire.stamp_ns(value.stamp);
  wire.T_map_robot(ToWire(value.T_map_robot));
  wire.weight(value.weight);
  return wire;
}
PoseHypothesis FromWire(v1::PoseHypothesis&& wire) {
  return {.stamp = wire.stamp_ns(), .T_map_robot = FromWire(wire.T_map_robot()), .weight = wire.weight()};
}

v1::Ledger ToWire(const Ledger& value) {
  v1::Ledger wire;
  wire.robot_id(value.robot_id);
  wire.sensor_id(value.sensor_id);
  wire.generation(value.generation);
  wire.robot(value.robot);
  wire.sensor(value.sensor);
  wire.site(value.site);
  wire.received(value.received);
  wire.used(value.used);
  wire.keyframes(value.keyframes);
  wire.waiting(value.waiting);
  wire.dropped().assign(value.dropped.begin(), value.dropped.end());
  wire.odometry_received(value.odometry_received);
  wire.odometry_dropped(value.odometry_dropped);
  wire.odometry_merged(value.odometry_merged);
  wire.session(value.session);
  wire.last_sequence(value.last_sequence);
  wire.settled_through(value.settled_through);
  wire.durable_through(value.durable_through);
  wire.last_stamp_ns(value.last_stamp);
  wire.latency_p50_ms(value.latency_p50_ms);
  wire.latency_p99_ms(value.latency_p99_ms);
  return wire;
}

Ledger FromWire(v1::Ledger&& wire) {
  Ledger value;
  value.robot_id = wire.robot_id();
  value.sensor_id = wire.sensor_id();
  value.generation = wire.generation();
  value.robot = std::move(wire.robot());
  value.sensor = std::move(wire.sensor());
  value.site = std::move(wire.site());
  value.received = wire.received();
  value.used = wire.used();
  value.keyframes = wire.keyframes();
  value.waiting = wire.waiting();
  const std::size_t known = std::min(wire.dropped().size(), value.dropped.size());
  std::copy_n(wire.dropped().begin(), known, value.dropped.begin());
  value.odometry_received = wire.odometry_received();
  value.odometry_dropped = wire.odometry_dropped();
  value.odometry_merged = wire.odometry_merged();
  value.session = wire.session();
  value.last_sequence = wire.last_sequence();
  value.settled_through = wire.settled_through();
  value.durable_through = wire.durable_through();
  value.last_stamp = wire.last_stamp_ns();
  value.latency_p50_ms = wire.latency_p50_ms();
  value.latency_p99_ms = wire.latency_p99_ms();
  return value;
}

v1::Job ToWire(const Job& value) {
  v1::Job wire;
  wire.id(value.id);
  wire.generation(value.generation);
  wire.site(value.site);
  wire.kind(static_cast<v1::JobKind>(value.kind));
  wire.state(static_cast<v1::JobState>(value.state));
  wire.progress(value.progress);
  wire.cost_before(value.cost_before);
  wire.cost_after(value.cost_after);
  wire.map_version(value.map_version);
  wire.submitted_ns(value.submitted);
  wire.started_ns(value.started);
  wire.ended_ns(value.ended);
  wire.message(value.message);
  wire.robot(value.robot);
  for (const PoseHypothesis& place : value.places) wire.places().push_back(ToWire(place));
  return wire;
}

Job FromWire(v1::Job&& wire) {
  Job value;
  value.id = wire.id();
  value.generation = wire.generation();
  value.site = std::move(wire.site());
  value.kind = static_cast<JobKind>(wire.kind());
  value.state = static_cast<JobState>(wire.state());
  value.progress = wire.progress();
  value.cost_before = wire.cost_before();
  value.cost_after = wire.cost_after();
  value.map_version = wire.map_version();
  value.submitted = wire.submitted_ns();
  value.started = wire.started_ns();
  value.ended = wire.ended_ns();
  value.message = std::move(wire.message());
  value.robot = std::move(wire.robot());
  for (v1::PoseHypothesis& place : wire.places()) value.places.push_back(FromWire(std::move(place)));
  return value;
}

}  // namespace cairn::wire
