// The records of one robot that drives through the world `building`.
#pragma once

#include <variant>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/sensor/log_reader.h"

namespace cairn::slam::test {

struct Drive {
  Pose2 T_map_robot_start;
  std::vector<LogRecord> records;
};

inline Drive SimulatedDrive(double seconds) {
  sim::FleetOptions options;
  options.robots = 1;
  options.scan_hz = 5.0;
  options.laser.beams = 181;
  options.laser.dropout_share = 0.01;
  auto fleet = sim::Fleet::Create(*sim::OpenWorld("building"), options);
  Drive drive{fleet->T_map_robot_start(0), {}};
  const Stamp end = options.first_stamp + StampFromSeconds(seconds);
  for (Stamp stamp = 0; stamp < end;) {
    drive.records.push_back(fleet->Next().record);
    stamp = std::visit([](const auto& record) { return record.stamp; }, drive.records.back());
  }
  return drive;
}

}  // namespace cairn::slam::test
