#include "server/slam/calibration/umbmark.h"

#include <cmath>
#include <random>

#include "tests/studies/calibration/calibration.h"

namespace cairn::studies {

void StudyUmbmark(StudyContext& context) {
  Report& report = context.report;
  report.Heading("UMBmark: wheel errors from square runs");
  report.Text(
      "The robot makes five runs in each direction round a square of 4 m, with a slip of 2 mm after 1 "
      "m. The table shows the mean and the spread of the recovered errors. The mean error must be at "
      "most 0.001 for E_d and 0.004 for E_b. After the correction the robot must not end farther from "
      "its start than a robot with perfect wheels does because of slip alone (first row), plus a tenth.");
  Table table({"injected E_d", "E_b", "recovered E_d", "+-", "E_b", "+-", "E_sys (m)", "after correction (m)"});
  const slam::UmbmarkOptions square;
  const int trials = context.Pick(500, 50);
  bool plausible = true;
  // E_sys of perfect wheels: no calibration from the same number of runs can do better.
  double by_slip = 0.0;
  Series before_cw{.label = "clockwise", .mark = Mark::kPoints},
      before_ccw{.label = "counter-clockwise", .mark = Mark::kPoints};
  for (const slam::WheelErrors injected :
       {slam::WheelErrors{1.0, 1.0}, {1.003, 1.0}, {1.0, 1.01}, {1.006, 0.985}, {0.99, 1.02}}) {
    double d = 0, dd = 0, b = 0, bb = 0, sys = 0, after = 0;
    for (int trial = 0; trial < trials; ++trial) {
      std::mt19937_64 engine(context.seed + static_cast<std::uint64_t>(trial));
      slam::SquareRunOptions run;
      run.errors = injected;
      std::vector<slam::SquareRun> runs;
      for (int i = 0; i < 10; ++i) runs.push_back(SimulateSquareRun(i % 2 == 0, run, square, engine));
      const auto result = EvaluateUmbmark(runs, square);
      if (!result) continue;
      if (injected.E_d == 1.006 && trial < 4)
        for (const slam::SquareRun& r : runs) {
          Series& series = r.clockwise ? before_cw : before_ccw;
          series.x.push_back(ReturnError(r).x);
          series.y.push_back(ReturnError(r).y);
        }
      d += result->errors.E_d / trials, dd += std::pow(result->errors.E_d - injected.E_d, 2) / trials;
      b += result->errors.E_b / trials, bb += std::pow(result->errors.E_b - injected.E_b, 2) / trials;
      sys += result->E_sys_m / trials;
      // The robot after the correction still has the part of the true errors that was not recovered.
      const slam::WheelErrors left{injected.E_d / result->errors.E_d, injected.E_b / result->errors.E_b};
      after += std::max(SquareEnd(true, left, square).translation().norm(),
                        SquareEnd(false, left, square).translation().norm()) /
               trials;
    }
    table.Add({Number(injected.E_d, 4), Number(injected.E_b, 4), Number(d, 5), Number(std::sqrt(dd), 5), Number(b, 5),
               Number(std::sqrt(bb), 5), Number(sys, 3), Number(after, 3)});
    plausible = plausible && std::abs(d - injected.E_d) < 0.001 && std::abs(b - injected.E_b) < 0.004;
    if (injected.E_d == 1.0 && injected.E_b == 1.0) by_slip = sys;
    plausible = plausible && after < 1.1 * by_slip;
  }
  report.Add(table, "umbmark");
  Plot plot{.title = "Return errors, E_d = 1.006, E_b = 0.985", .x = {"x", "m"}, .y = {"y", "m"}};
  plot.series = {before_cw, before_ccw};
  plot.equal_scale = true;
  report.Add(plot, "umbmark-runs");
  report.Expect(plausible,
                "the wheel errors recovered by UMBmark differ from the injected ones by more than the stated "
                "bounds");
}

}  // namespace cairn::studies
