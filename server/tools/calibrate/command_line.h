// The command line of cairn-calibrate: `odometry` (UMBmark), `motion` (motion models from a log) and `laser` (lidar and
// wheels from a log).
#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace cairn::server {

// Runs one command line, given without the program's name. Returns the exit code: 0 done, 1 failed (one line
// on `err` and, with --json, an object with `error` on `out`), 2 wrong command line.
[[nodiscard]] int RunCalibrate(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err);

}  // namespace cairn::server
