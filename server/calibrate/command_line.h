// cairn-calibrate's command line: `odometry` (UMBmark) and `motion` (motion models from a log).
#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace cairn::server {

// Runs one command line, without the program's name. Answers the exit code: 0 done, 1 failed (one line on `err`, and
// under --json an object with `error` on `out`), 2 wrong command line.
[[nodiscard]] int RunCalibrate(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err);

}  // namespace cairn::server
