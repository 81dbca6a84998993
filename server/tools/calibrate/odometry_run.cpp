#include "server/tools/calibrate/odometry_run.h"

#include <array>
#include <cmath>
#include <iomanip>
#include <random>
#include <sstream>
#include <string>

#include "common/file/atomic_file.h"
#include "common/options/number_text.h"
#include "server/tools/log_run/json_line.h"

namespace cairn::server {
namespace {

constexpr std::string_view kHeader = "direction,floor,abs_x,abs_y,abs_theta,calc_x,calc_y,calc_theta";
constexpr std::size_t kMaxBytes = 16u << 20;
constexpr double kMaxValue = 1e4;

std::string_view Trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::vector<std::string_view> Fields(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const auto comma = line.find(',');
    fields.push_back(Trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

tl::expected<double, std::string> Number(std::string_view text) {
  double value = 0.0;
  if (!ParseNumber(text, value) || !std::isfinite(value) || std::abs(value) > kMaxValue)
    return tl::unexpected("'" + std::string(text.substr(0, 40)) + "' is not a number within +-10000");
  return value;
}

tl::expected<void, std::string> TakeRun(std::string_view line, SquareRuns& runs) {
  const auto fields = Fields(line);
  if (fields.size() != 8) return tl::unexpected("has " + std::to_string(fields.size()) + " fields, not 8");
  if (fields[0] != "cw" && fields[0] != "ccw") return tl::unexpected(std::string("direction must be cw or ccw"));
  if (fields[1] != "smooth" && fields[1] != "bumps")
    return tl::unexpected(std::string("floor must be smooth or bumps"));
  std::array<double, 6> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto number = Number(fields[i + 2]);
    if (!number) return tl::unexpected(number.error());
    numbers[i] = *number;
  }
  const slam::SquareRun run{fields[0] == "cw",
                            {numbers[0], numbers[1], WrapAngle(numbers[2])},
                            {numbers[3], numbers[4], WrapAngle(numbers[5])}};
  (fields[1] == "smooth" ? runs.smooth : runs.bumpy).push_back(run);
  return {};
}

SquareRuns Simulated(const OdometryRunOptions& options) {
  SquareRuns runs;
  std::mt19937_64 engine(options.seed);
  for (int i = 0; i < options.simulated_runs; ++i) {
    for (const bool clockwise : {true, false}) {
      slam::SquareRunOptions run = options.run;
      if (run.bumps > 0) runs.bumpy.push_back(SimulateSquareRun(clockwise, run, options.square, engine));
      run.bumps = 0;
      runs.smooth.push_back(SimulateSquareRun(clockwise, run, options.square, engine));
    }
  }
  return runs;
}

double Degrees(double radians) {
  return radians * 180.0 / kPi;
}

}  // namespace

Result<SquareRuns> ParseSquareRuns(std::string_view text, const std::string& source) {
  SquareRuns runs;
  bool header = false;
  for (int number = 1; !text.empty(); ++number) {
    const auto end = text.find('\n');
    const std::string_view line = Trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line.front() == '#') continue;
    const auto fail = [&](const std::string& why) {
      return Fail(StatusCode::kInvalidArgument, source + ":" + std::to_string(number) + ": " + why);
    };
    if (!header) {
      if (line != kHeader) return fail("the first line must be `" + std::string(kHeader) + "`");
      header = true;
    } else if (const auto taken = TakeRun(line, runs); !taken) {
      return fail(taken.error());
    }
  }
  if (runs.smooth.empty()) return Fail(StatusCode::kInvalidArgument, source + ": no runs on a smooth floor");
  return runs;
}

Result<SquareRuns> ReadSquareRuns(const std::filesystem::path& path) {
  const auto bytes = ReadWholeFile(path, kMaxBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  return ParseSquareRuns({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, path.string());
}

Result<OdometryReport> RunOdometry(const OdometryRunOptions& options) {
  Result<SquareRuns> runs = options.simulate ? Simulated(options) : ReadSquareRuns(options.runs);
  if (!runs) return tl::unexpected(runs.error());
  const auto result = EvaluateUmbmark(runs->smooth, options.square);
  if (!result) return tl::unexpected(result.error());
  OdometryReport report{options.square, *result, std::nullopt, std::nullopt};
  if (!runs->bumpy.empty()) {
    const auto error = NonSystematicError(runs->smooth, runs->bumpy);
    if (!error) return tl::unexpected(error.error());
    report.non_systematic_rad = *error;
  }
  if (options.simulate) report.injected = options.run.errors;
  return report;
}

std::string ReportText(const OdometryReport& report) {
  const slam::UmbmarkResult& r = report.result;
  std::ostringstream out;
  out << std::fixed << std::setprecision(4);
  out << "runs            " << r.clockwise_runs << " clockwise, " << r.counter_runs << " counter-clockwise, square of "
      << report.square.side_m << " m\n"
      << "return errors   clockwise centre " << r.center_cw.x() << ", " << r.center_cw.y() << " m; counter-clockwise "
      << r.center_ccw.x() << ", " << r.center_ccw.y() << " m\n"
      << "systematic      E_sys " << r.E_sys_m << " m (3.10); with the correction " << r.E_sys_left_m
      << " m would remain\n"
      << "per turn        alpha " << Degrees(r.alpha_rad) << " deg, beta " << Degrees(r.beta_rad) << " deg\n"
      << std::setprecision(6) << "wheel sizes     E_d = D_R / D_L = " << r.errors.E_d << " +- " << r.sigma.E_d
      << " (small-angle formula " << r.small_angle.E_d << ")\n"
      << "wheel base      E_b = true / believed = " << r.errors.E_b << " +- " << r.sigma.E_b << " (small-angle formula "
      << r.small_angle.E_b << ")\n";
  if (report.injected)
    out << "injected        E_d " << report.injected->E_d << ", E_b " << report.injected->E_b << "; off by "
        << r.errors.E_d - report.injected->E_d << " and " << r.errors.E_b - report.injected->E_b << '\n';
  out << "corrected       base " << r.corrected.base_m << " m, left wheel " << r.corrected.left_diameter_m
      << " m, right wheel " << r.corrected.right_diameter_m << " m\n";
  if (report.non_systematic_rad)
    out << std::setprecision(4) << "non-systematic  " << Degrees(*report.non_systematic_rad) << " deg (3.11)\n";
  return out.str();
}

std::string ReportJson(const OdometryReport& report) {
  const slam::UmbmarkResult& r = report.result;
  const auto errors = [](const slam::WheelErrors& e) { return Json{{"E_d", e.E_d}, {"E_b", e.E_b}}; };
  Json object = {{"clockwise_runs", r.clockwise_runs},
                 {"counter_runs", r.counter_runs},
                 {"side_m", report.square.side_m},
                 {"center_cw_m", {r.center_cw.x(), r.center_cw.y()}},
                 {"center_ccw_m", {r.center_ccw.x(), r.center_ccw.y()}},
                 {"E_sys_m", r.E_sys_m},
                 {"E_sys_left_m", r.E_sys_left_m},
                 {"alpha_rad", r.alpha_rad},
                 {"beta_rad", r.beta_rad},
                 {"errors", errors(r.errors)},
                 {"sigma", errors(r.sigma)},
                 {"small_angle", errors(r.small_angle)},
                 {"corrected",
                  {{"base_m", r.corrected.base_m},
                   {"left_diameter_m", r.corrected.left_diameter_m},
                   {"right_diameter_m", r.corrected.right_diameter_m}}}};
  if (report.non_systematic_rad) object["non_systematic_rad"] = *report.non_systematic_rad;
  if (report.injected) object["injected"] = errors(*report.injected);
  return JsonLine(object);
}

}  // namespace cairn::server
