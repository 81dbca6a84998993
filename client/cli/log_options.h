// The options of commands that read a log. They tell what the file itself does not contain.
#pragma once

#include <CLI/CLI.hpp>

#include "common/sensor/log_reader.h"

namespace cairn::client {

inline void AddLogOptions(CLI::App& command, LogReaderOptions& options) {
  command
      .add_option("--no-return", options.no_return_m,
                  "A range of this length or more hit nothing; 0: find the limit from the log")
      ->check(CLI::NonNegativeNumber)
      ->type_name("METRES");
  command
      .add_option("--laser-forward", options.dpslam_laser_forward_m,
                  "DP-SLAM logs: distance of the laser ahead of the pivot")
      ->type_name("METRES")
      ->capture_default_str();
  command
      .add_option("--scan-period", options.dpslam_scan_period_s,
                  "DP-SLAM logs, which have no stamps: time between two scans")
      ->check(CLI::PositiveNumber)
      ->type_name("SECONDS")
      ->capture_default_str();
}

}  // namespace cairn::client
