// Reads the ends of UMBmark runs from a text file: `#` comments and blank lines, the header
// `direction,floor,abs_x,abs_y,abs_theta,calc_x,calc_y,calc_theta`, then one run a line (cw|ccw, smooth|bumps, six
// numbers in m and rad). A line that makes no sense is an error that names it; nothing is guessed.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "common/status.h"
#include "server/slam/motion/umbmark.h"

namespace cairn::server {

struct SquareRuns {
  std::vector<slam::SquareRun> smooth;
  std::vector<slam::SquareRun> bumpy;
};

// `source` names the text in errors.
[[nodiscard]] Result<SquareRuns> ParseSquareRuns(std::string_view text, const std::string& source);
[[nodiscard]] Result<SquareRuns> ReadSquareRuns(const std::filesystem::path& path);

}  // namespace cairn::server
