// `cairn-calibrate odometry`: UMBmark over a file of runs, or over simulated runs with known errors.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/status.h"
#include "server/slam/calibration/umbmark.h"

namespace cairn::server {

// The ends of UMBmark runs, as read from a text file: `#` comments and blank lines, the header
// `direction,floor,abs_x,abs_y,abs_theta,calc_x,calc_y,calc_theta`, then one run a line (cw|ccw, smooth|bumps, six
// numbers in m and rad). A line that cannot be read is an error that names the line.
struct SquareRuns {
  std::vector<slam::SquareRun> smooth;
  std::vector<slam::SquareRun> bumpy;
};

// `source` is the name of the text in error messages.
[[nodiscard]] Result<SquareRuns> ParseSquareRuns(std::string_view text, const std::string& source);
[[nodiscard]] Result<SquareRuns> ReadSquareRuns(const std::filesystem::path& path);

struct OdometryRunOptions {
  std::filesystem::path runs;
  bool simulate = false;   // Use simulated runs in place of a file.
  int simulated_runs = 5;  // Runs in each direction. If bumps are simulated, as many again over bumps.
  std::uint64_t seed = 1;
  slam::SquareRunOptions run;
  slam::UmbmarkOptions square;
};

struct OdometryReport {
  slam::UmbmarkOptions square;
  slam::UmbmarkResult result;
  std::optional<double> non_systematic_rad;   // (3.11); set if there are runs over bumps.
  std::optional<slam::WheelErrors> injected;  // The true errors of a simulation.
};

[[nodiscard]] Result<OdometryReport> RunOdometry(const OdometryRunOptions& options);
[[nodiscard]] std::string ReportText(const OdometryReport& report);
[[nodiscard]] std::string ReportJson(const OdometryReport& report);

}  // namespace cairn::server
