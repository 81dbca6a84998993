#include <utility>

#include "common/wire/convert.h"

namespace cairn::wire {

v1::Scan ToWire(const ScanSample& value) {
  const Scan& scan = value.scan;
  v1::Scan wire;
  wire.robot_id(value.stream.robot_id);
  wire.sensor_id(value.stream.sensor_id);
  wire.session(value.stream.session);
  wire.seq(scan.sequence);
  wire.stamp_ns(scan.stamp);
  wire.angle_first_rad(scan.angle_first_rad);
  wire.angle_step_rad(scan.angle_step_rad);
  wire.range_min_m(scan.range_min_m);
  wire.range_max_m(scan.range_max_m);
  wire.beam_period_s(scan.beam_period_s);
  wire.tilt_rad(scan.tilt_rad);
  wire.T_robot_laser(ToWire(scan.T_robot_laser));
  wire.ranges_m(scan.ranges_m);
  return wire;
}

ScanSample FromWire(v1::Scan&& wire) {
  ScanSample value;
  value.stream = {wire.robot_id(), wire.sensor_id(), wire.session()};
  Scan& scan = value.scan;
  scan.sequence = wire.seq();
  scan.stamp = wire.stamp_ns();
  scan.angle_first_rad = wire.angle_first_rad();
  scan.angle_step_rad = wire.angle_step_rad();
  scan.range_min_m = wire.range_min_m();
  scan.range_max_m = wire.range_max_m();
  scan.beam_period_s = wire.beam_period_s();
  scan.tilt_rad = wire.tilt_rad();
  scan.T_robot_laser = FromWire(wire.T_robot_laser());
  scan.ranges_m = std::move(wire.ranges_m());
  OrderByTime(scan);
  return value;
}

v1::Odometry ToWire(const OdometrySample& value) {
  v1::Odometry wire;
  wire.robot_id(value.stream.robot_id);
  wire.sensor_id(value.stream.sensor_id);
  wire.session(value.stream.session);
  wire.seq(value.odometry.sequence);
  wire.stamp_ns(value.odometry.stamp);
  wire.T_odom_robot(ToWire(value.odometry.T_odom_robot));
  return wire;
}

OdometrySample FromWire(v1::Odometry&& wire) {
  OdometrySample value;
  value.stream = {wire.robot_id(), wire.sensor_id(), wire.session()};
  value.odometry.sequence = wire.seq();
  value.odometry.stamp = wire.stamp_ns();
  value.odometry.T_odom_robot = FromWire(wire.T_odom_robot());
  return value;
}

}  // namespace cairn::wire
