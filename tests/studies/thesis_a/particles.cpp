#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "tests/studies/log_run.h"
#include "tests/studies/mapper_choice.h"
#include "tests/studies/thesis_a/thesis_a.h"

namespace cairn::studies {
namespace {

struct Printed {
  int particles;
  double mean_s, max_s;
};
// Table 5.18.
constexpr Printed kPrinted[] = {{50, 0.0911, 0.2084},  {100, 0.0934, 0.2670}, {150, 0.0974, 0.3324},
                                {200, 0.1015, 0.3924}, {250, 0.1039, 0.4519}, {300, 0.1082, 0.5115},
                                {350, 0.1117, 0.5796}, {400, 0.1150, 0.6433}, {450, 0.1189, 0.7235}};

// Mean, worst and best over the trials.
struct Trials {
  std::vector<double> values;
  void Add(double value) { values.push_back(value); }
  [[nodiscard]] Distribution distribution() const { return DistributionOf(values); }
  [[nodiscard]] double best() const {
    return values.empty() ? std::numeric_limits<double>::quiet_NaN() : *std::min_element(values.begin(), values.end());
  }
};

void Extend(Series& series, double x, const Trials& trials) {
  series.x.push_back(x);
  series.y.push_back(trials.distribution().mean);
  series.low.push_back(trials.best());
  series.high.push_back(trials.distribution().max);
}

std::string Spread(const Trials& trials, int decimals) {
  return Number(trials.distribution().mean, decimals) + " (" + Number(trials.best(), decimals) + "-" +
         Number(trials.distribution().max, decimals) + ")";
}

void SweepLog(StudyContext& context, const StudyLog& log, bool lines_only) {
  Report& report = context.report;
  const int seeds = context.Pick(log.scans() > 5000 ? 3 : 5, 1);
  const std::string system = lines_only ? "lines only" : "as shipped", tag = lines_only ? "_lines" : "";
  Table table({"particles (" + log.name + ", " + system + ")", "thesis mean (s)", "thesis max (s)", "ours mean (s)",
               "ours max (s)", "online error (m)", "online (deg)", "full error (m)", "full (deg)"});
  Plot metres{
      .title = "Mean position error against particles, " + log.name + ", " + system + " (band: worst and best trial)",
      .x = {"particles", ""},
      .y = {"mean error of relations", "m", false, 0.0, {}}};
  Plot degrees{.title = "Mean orientation error against particles, " + log.name + ", " + system,
               .x = {"particles", ""},
               .y = {"mean error of relations", "deg", false, 0.0, {}}};
  metres.series = degrees.series = {{.label = "online"}, {.label = "full"}};
  Plot times{.title = "Time per scan against particles, " + log.name + ", " + system + " (thesis: Table 5.18)",
             .x = {"particles", ""},
             .y = {"time", "s", true}};
  times.series = {{.label = "ours, mean"},
                  {.label = "ours, max"},
                  {.label = "thesis, mean", .mark = Mark::kDashed},
                  {.label = "thesis, max", .mark = Mark::kDashed}};
  double first_mean = 0.0, last_mean = 0.0;
  const auto limits = AccuracyLimitsOf(log);
  std::vector<double> full_means_m;
  for (const Printed& printed : kPrinted) {
    if (context.quick && printed.particles % 200 != 50) continue;
    Trials mean_s, max_s, online_m, online_deg, full_m, full_deg;
    for (int seed = 0; seed < seeds; ++seed) {
      std::vector<std::string> assignments{"slam.particles=" + Count(printed.particles)};
      if (lines_only) {
        const std::vector<std::string> pure = LinesOnly();
        assignments.insert(assignments.end(), pure.begin(), pure.end());
      }
      const auto options = MapperWith(assignments, context.seed + static_cast<std::uint64_t>(seed));
      if (!options) return report.Fault(options.error().message);
      const LogRun run = RunOverLog(log, *options);
      const RelationError online = ErrorOf(run.online, log.relations), full = ErrorOf(run.full, log.relations);
      mean_s.Add(run.time_ms().mean / 1e3), max_s.Add(run.time_ms().max / 1e3);
      online_m.Add(online.trans_mean_m), online_deg.Add(online.rot_mean_deg);
      full_m.Add(full.trans_mean_m), full_deg.Add(full.rot_mean_deg);
    }
    full_means_m.push_back(full_m.distribution().mean);
    const double worst_m = std::max(online_m.distribution().mean, full_m.distribution().mean);
    const double allowed_m = !limits ? 0.0 : lines_only ? limits->lines_only_m : limits->shipped_m;
    report.Expect(!limits || worst_m <= allowed_m, log.name + ", " + system + ", " + Count(printed.particles) +
                                                       " particles: the mean error is " + Number(worst_m, 3) +
                                                       " m, more than " + Number(allowed_m, 3));
    const double n = printed.particles;
    table.Add({Count(printed.particles), Number(printed.mean_s, 4), Number(printed.max_s, 4),
               Number(mean_s.distribution().mean, 5), Number(max_s.distribution().mean, 4), Spread(online_m, 3),
               Spread(online_deg, 2), Spread(full_m, 3), Spread(full_deg, 2)});
    Extend(metres.series[0], n, online_m), Extend(metres.series[1], n, full_m);
    Extend(degrees.series[0], n, online_deg), Extend(degrees.series[1], n, full_deg);
    const double ours[] = {mean_s.distribution().mean, max_s.distribution().mean, printed.mean_s, printed.max_s};
    for (std::size_t i = 0; i < 4; ++i) times.series[i].x.push_back(n), times.series[i].y.push_back(ours[i]);
    if (first_mean == 0.0) first_mean = ours[0];
    last_mean = ours[0];
  }
  report.Text("Means over " + Count(seeds) + " seeds, best and worst in brackets.");
  report.Add(table, "table_5_18_" + log.name + tag);
  report.Add(metres, "particles_m_" + log.name + tag);
  report.Add(degrees, "particles_deg_" + log.name + tag);
  report.Add(times, "particles_time_" + log.name + tag);
  report.Expect(full_means_m.back() < 1.5 * full_means_m.front() + 0.02,
                log.name + ", " + system +
                    ": the error with the largest number of particles is clearly larger than with the smallest");
  if (last_mean < 0.9 * first_mean)
    report.Warn("more particles took less time, so the machine was too busy for measuring times");
}

}  // namespace

void StudyParticles(StudyContext& context, const std::vector<StudyLog>& logs) {
  context.report.Heading("Number of particles (5.7.1, Table 5.18, Figures 5.44-5.46)");
  for (const StudyLog& log : logs) {
    SweepLog(context, log, false);
    SweepLog(context, log, true);
  }
}

}  // namespace cairn::studies
