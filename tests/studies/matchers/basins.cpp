#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "tests/studies/matchers/match_trial.h"
#include "tests/studies/matchers/matchers.h"

namespace cairn::studies {
namespace {

// The largest error (column or row) up to which the share stays above 90 %, going out from the middle.
double Reach(const std::vector<double>& axis, const std::vector<double>& shares, std::size_t stride) {
  double reach = 0.0;
  for (std::size_t i = 0; i < axis.size(); ++i) {
    if (shares[i * stride] < 0.9) break;
    reach = axis[i];
  }
  return reach;
}

}  // namespace

void StudyBasins(StudyContext& context, const std::vector<slam::MatcherKind>& kinds) {
  Report& report = context.report;
  report.Heading("Convergence basins");
  report.Text(
      "The figures are the share of right answers (converged, within 0.10 m and 2 deg) if the guess is "
      "wrong by a given distance in any direction and by a given turn to either side. The worlds are "
      "`building` and `room`, with 181 beams and a range noise of 1 cm. The matcher is given a "
      "standard deviation of 1 m and 45 deg, so that the guess has little weight. Limits of the "
      "options that would exclude large errors are widened: the check of voting against odometry is "
      "off, and its candidates reach as far as the largest error; hough, correlative and ndt_de search "
      "1.6 m and 95 deg. With their default options they stop at their limits.");
  const std::vector<double> metres = context.quick
                                         ? std::vector<double>{0, 0.2, 0.5, 1.0, 1.5}
                                         : std::vector<double>{0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.5};
  const std::vector<double> degrees = context.quick ? std::vector<double>{0, 10, 30, 60, 90}
                                                    : std::vector<double>{0, 5, 10, 15, 20, 30, 40, 50, 60, 75, 90};
  Table table({"matcher", "right with a perfect guess", "90 % right up to (m), no turn",
               "90 % right up to (deg), no shift", "mean over the map"});
  slam::MatcherOptions options;
  options.voting.fault.enabled = false;
  options.voting.candidates.max_rotation_rad = Radians(95);
  options.voting.candidates.max_translation_m = 1.6;
  options.ndt_de.search.back_m = options.ndt_de.search.ahead_m = options.ndt_de.search.aside_m = 1.6;
  options.ndt_de.search.turn_rad = Radians(95);
  options.hough.max_translation_m = options.correlative.window_m = 1.6;
  options.correlative.window_rad = Radians(95);
  for (const slam::MatcherKind kind : kinds) {
    const std::string name(slam::MatcherName(kind));
    HeatMap map{.title = "Basin of " + name + ": share of right answers",
                .x = {"guess off by", "m"},
                .y = {"guess turned by", "deg"},
                .columns = metres,
                .rows = degrees,
                .value_label = "right",
                .print_values = true};
    double sum = 0.0;
    for (const double degree : degrees) {
      for (const double metre : metres) {
        sim::Random random(context.seed);  // The same pairs of scans in every cell.
        std::uniform_real_distribution<double> unit(0.0, 1.0);
        int good = 0, cases = 0;
        for (const char* world : {"building", "room"}) {
          const Scene scene(world);
          for (int i = 0; i < context.Pick(20, 6); ++i) {
            const MatchCase match_case = DrawCase(scene, {}, random);
            const double direction = 2 * kPi * unit(random), side = unit(random) < 0.5 ? -1.0 : 1.0;
            const Pose2 off{metre * std::cos(direction), metre * std::sin(direction), side * Radians(degree)};
            good += TryMatch(match_case, off, 1.0, Radians(45), kind, options).good();
            ++cases;
          }
        }
        map.values.push_back(1.0 * good / cases);
        sum += map.values.back();
      }
    }
    table.Add({name, Percent(map.values.front(), 0), Number(Reach(metres, map.values, 1), 2),
               Number(Reach(degrees, map.values, metres.size()), 0),
               Percent(sum / static_cast<double>(map.values.size()), 0)});
    report.Add(map, "basin_" + name);
    report.Expect(map.values.front() >= 0.5,
                  name + " is right in less than half of the cases even from a perfect guess");
  }
  report.Add(table, "basins");
}

}  // namespace cairn::studies
