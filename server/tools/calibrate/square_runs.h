// Reads the ends of UMBmark runs from a text file: `#` comments and blank lines, the header
// `direction,floor,abs_x,abs_y,abs_theta,calc_x,calc_y,calc_theta`, then one run a line (cw|ccw, smooth|bumps, six
// numbers in m and rad). A line that cannot be read is an error that names the line.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "common/status.h"
#include "server/slam/calibration/umbmark.h"

namespace cairn::server {

struct SquareRuns {
  std::vector<slam::SquareRun> smooth;
  std::vector<slam::SquareRun> bumpy;
};

// `source` is the name of the text in error messages.
[[nodiscard]] Result<SquareRuns> ParseSquareRuns(std::string_view text, const std::string& source);
[[nodiscard]] Result<SquareRuns> ReadSquareRuns(const std::filesystem::path& path);

}  // namespace cairn::server
