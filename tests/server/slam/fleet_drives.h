// Robots that drive through a shipped world at the same time without seeing each other: what each of them sends, in the
// order of time, and where it truly is. For the sweeps of robots that nobody watched for a while.
#pragma once

#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"

namespace cairn::test {

struct FleetDrive {
  struct Timed {
    double seconds = 0.0;  // Since the drive began.
    LogRecord record;
  };
  Pose2 T_map_robot_start;
  std::vector<Timed> records;
  Trajectory truth;
};

inline std::vector<FleetDrive> DriveFleet(const std::string& world, int robots, double seconds, std::uint64_t seed) {
  sim::FleetOptions options;
  options.robots = robots;
  options.see_each_other = false;
  options.scan_hz = 5.0;
  options.odometry_hz = 10.0;
  options.laser.beams = 181;
  options.seed = seed;
  auto fleet = sim::Fleet::Create(*sim::OpenWorld(world), options);
  std::vector<FleetDrive> drives(static_cast<std::size_t>(robots));
  for (double now = 0.0; now < seconds;) {
    sim::FleetRecord next = fleet->Next();
    now = SecondsFromStamp(std::visit([](const auto& one) { return one.stamp; }, next.record) - options.first_stamp);
    drives[static_cast<std::size_t>(next.robot)].records.push_back({now, std::move(next.record)});
  }
  for (int i = 0; i < robots; ++i) {
    drives[static_cast<std::size_t>(i)].T_map_robot_start = fleet->T_map_robot_start(i);
    drives[static_cast<std::size_t>(i)].truth = fleet->truth(i);
  }
  return drives;
}

}  // namespace cairn::test
