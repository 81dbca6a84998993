#include <utility>

#include "common/wire/convert.h"

namespace cairn::wire {

v1::Pose2 ToWire(const Pose2& value) {
  v1::Pose2 wire;
  wire.x(value.x);
  wire.y(value.y);
  wire.theta(value.theta);
  return wire;
}

Pose2 FromWire(const v1::Pose2& wire) {
  return {wire.x(), wire.y(), wire.theta()};
}

v1::Status ToWire(const Status& value) {
  v1::Status wire;
  wire.code(static_cast<std::int32_t>(value.code));
  wire.message(value.message);
  return wire;
}

Status FromWire(v1::Status&& wire) {
  return {static_cast<StatusCode>(wire.code()), std::move(wire.message())};
}

v1::SessionRequest ToWire(const SessionRequest& value) {
  v1::SessionRequest wire;
  wire.robot_id(HashName(value.robot));
  wire.client(value.client);
  wire.session(value.session);
  wire.robot(value.robot);
  wire.site(value.site);
  wire.sensors(value.sensors);
  wire.has_start(value.has_start);
  wire.T_map_robot_start(ToWire(value.T_map_robot_start));
  wire.map_frame(value.map_frame);
  wire.started(value.started);
  wire.end(value.end);
  return wire;
}

SessionRequest FromWire(v1::SessionRequest&& wire) {
  SessionRequest value;
  value.robot = std::move(wire.robot());
  value.site = std::move(wire.site());
  value.sensors = std::move(wire.sensors());
  value.client = wire.client();
  value.session = wire.session();
  value.has_start = wire.has_start();
  value.T_map_robot_start = FromWire(wire.T_map_robot_start());
  value.map_frame = wire.map_frame();
  value.started = wire.started();
  value.end = wire.end();
  return value;
}

v1::SessionState ToWire(const SessionState& value) {
  v1::SessionState wire;
  wire.robot_id(value.robot_id);
  wire.generation(value.generation);
  wire.client(value.client);
  wire.session(value.session);
  wire.robot(value.robot);
  wire.site(value.site);
  wire.phase(static_cast<v1::SessionPhase>(value.phase));
  wire.durable(value.durable);
  wire.map_frame(value.map_frame);
  wire.localise_only(value.localise_only);
  wire.fragment(value.fragment);
  wire.stale(value.stale);
  wire.status(ToWire(value.status));
  return wire;
}

SessionState FromWire(v1::SessionState&& wire) {
  SessionState value;
  value.robot_id = wire.robot_id();
  value.generation = wire.generation();
  value.client = wire.client();
  value.session = wire.session();
  value.robot = std::move(wire.robot());
  value.site = std::move(wire.site());
  value.phase = static_cast<SessionPhase>(wire.phase());
  value.durable = wire.durable();
  value.map_frame = wire.map_frame();
  value.localise_only = wire.localise_only();
  value.fragment = wire.fragment();
  value.stale = wire.stale();
  value.status = FromWire(std::move(wire.status()));
  return value;
}

v1::SessionRefusal ToWire(const SessionRefusal& value) {
  v1::SessionRefusal wire;
  wire.state(ToWire(value.state));
  return wire;
}

SessionRefusal FromWire(v1::SessionRefusal&& wire) {
  return {FromWire(std::move(wire.state()))};
}

}  // namespace cairn::wire
