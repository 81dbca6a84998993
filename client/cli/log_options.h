// The options of commands that read a log: what the file itself does not say.
#pragma once

#include <CLI/CLI.hpp>

#include "common/sensor/log_reader.h"

namespace cairn::client {

inline void AddLogOptions(CLI::App& command, LogReaderOptions& options) {
  command.add_option("--no-return", options.no_return_m, "Ranges from here on hit nothing; 0: found from the log")
      ->check(CLI::NonNegativeNumber)
      ->type_name("METRES");
  command.add_option("--laser-forward", options.dpslam_laser_forward_m, "DP-SLAM logs: laser ahead of the pivot")
      ->type_name("METRES")
      ->capture_default_str();
  command.add_option("--scan-period", options.dpslam_scan_period_s, "DP-SLAM logs, which carry no time")
      ->check(CLI::PositiveNumber)
      ->type_name("SECONDS")
      ->capture_default_str();
}

}  // namespace cairn::client
