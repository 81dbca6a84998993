// The records of one robot that drives through the world `building`.
#pragma once

#include <optional>
#include <string_view>
#include <utility>
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

// The same drive with another odometry: "none", "late" (from the first third of the records on), "stands" (from then on
// it stands), "returns" (it stands in the second third).
inline Drive WithOdometry(Drive drive, std::string_view kind) {
  std::vector<LogRecord> records;
  std::optional<Pose2> stands;
  const std::size_t third = drive.records.size() / 3;
  for (std::size_t i = 0; i < drive.records.size(); ++i) {
    LogRecord& record = drive.records[i];
    if (auto* const odometry = std::get_if<Odometry>(&record)) {
      if (kind == "none" || (kind == "late" && i < third)) continue;
      if (i >= third && (kind == "stands" || (kind == "returns" && i < 2 * third))) {
        if (!stands) stands = odometry->T_odom_robot;
        odometry->T_odom_robot = *stands;
      }
    }
    records.push_back(std::move(record));
  }
  drive.records = std::move(records);
  return drive;
}

}  // namespace cairn::slam::test
