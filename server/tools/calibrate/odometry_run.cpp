#include "server/tools/calibrate/odometry_run.h"

#include <iomanip>
#include <random>
#include <sstream>

#include "server/tools/calibrate/square_runs.h"
#include "server/tools/log_run/json_line.h"

namespace cairn::server {
namespace {

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
