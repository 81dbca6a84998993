// A simulated log as a robot's driver hands it over: the array of beams is turned over and begins elsewhere, the stamp
// is that of the last beam and late, wheels are not as odometry believes, and the lidar is not mounted where the log
// says.
#pragma once

#include <algorithm>
#include <ostream>
#include <stdexcept>
#include <variant>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/sensor/carmen_writer.h"
#include "server/slam/calibration/odometry_path.h"

namespace cairn::server::test {

struct HandedOverDrive {
  std::string world = "office";
  sim::FleetOptions robot;
  double seconds = 90.0;
  double lag_s = 0.0;  // Besides the time from the first beam to the last, which the stamps are late, too.
  Pose2 T_robot_laser_logged;
  // Odometry reports the step that a robot with other wheels would have made: truth = wheels.Apply(reported).
  slam::WheelCorrection wheels;
};

// The array counter-clockwise from -180 deg on, whatever the lidar did; the scan's own timing is taken away.
inline Scan HandedOver(const Scan& measured, double lag_s) {
  Scan scan = measured;
  const auto beams = static_cast<double>(scan.ranges_m.size());
  scan.stamp += StampFromSeconds((beams - 1.0) * scan.beam_period_s + lag_s);
  scan.beam_period_s = 0.0;
  if (scan.angle_step_rad < 0.0) {
    scan.angle_first_rad += (beams - 1.0) * scan.angle_step_rad;
    scan.angle_step_rad = -scan.angle_step_rad;
    std::reverse(scan.ranges_m.begin(), scan.ranges_m.end());
  }
  return scan;
}

inline void WriteHandedOver(const HandedOverDrive& drive, std::ostream& out) {
  auto world = sim::OpenWorld(drive.world);
  if (!world) throw std::invalid_argument("HandedOverDrive: no such world");
  auto fleet = sim::Fleet::Create(*std::move(world), drive.robot);
  if (!fleet) throw std::invalid_argument(fleet.error().message);
  std::vector<Scan> scans;
  std::vector<Odometry> odometry;
  std::optional<Pose2> last;
  for (Stamp now = 0; now < drive.robot.first_stamp + StampFromSeconds(drive.seconds);) {
    const LogRecord record = fleet->Next().record;
    if (const auto* scan = std::get_if<Scan>(&record)) {
      scans.push_back(HandedOver(*scan, drive.lag_s));
      continue;
    }
    Odometry sample = std::get<Odometry>(record);
    now = sample.stamp;
    const Pose2 step = last ? Between(*last, sample.T_odom_robot) : Pose2{};
    last = sample.T_odom_robot;
    const slam::WheelCorrection& w = drive.wheels;
    const double way = step.x / w.wheel_scale;
    const Pose2 reported{way, step.y / w.wheel_scale, (step.theta - w.turn_per_m * way) / w.turn_scale};
    sample.T_odom_robot = odometry.empty() ? Pose2{} : odometry.back().T_odom_robot * reported;
    odometry.push_back(sample);
  }
  const slam::OdometryPath path(odometry, {});
  CarmenWriter writer(out);
  std::size_t next = 0;
  for (Scan& scan : scans) {
    for (; next < odometry.size() && odometry[next].stamp < scan.stamp; ++next) writer.Write(odometry[next]);
    const auto T_odom_robot = path.At(scan.stamp);
    if (!T_odom_robot) continue;
    scan.T_robot_laser = drive.T_robot_laser_logged;
    writer.Write(scan, *T_odom_robot);
  }
}

}  // namespace cairn::server::test
