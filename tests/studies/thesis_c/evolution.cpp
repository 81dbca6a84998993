#include <algorithm>
#include <string>
#include <vector>

#include "tests/studies/stopwatch.h"
#include "tests/studies/thesis_c/ndt_study.h"
#include "tests/studies/thesis_c/thesis_c.h"

namespace cairn::studies {
namespace {

// The parameter that is varied, and what the thesis states about it in words (its curves have no numbers).
struct Setting {
  std::string label;
  std::string printed;
  slam::EvolutionOptions evolution;
};

struct Outcome {
  double mean_m = 0.0;
  int lost = 0;
};

std::vector<Outcome> Sweep(StudyContext& context, const ScanSequence& drive, const std::vector<Setting>& settings,
                           const std::string& what, const std::string& tag) {
  Table table({what, "thesis", "mean (m)", "p95 (m)", "max (m)", "mean (deg)", "max (deg)", "off by > 0.1 m or 2 deg",
               "mean fitness", "cpu (ms)"});
  Plot metres{.title = "Error of the displacement against the pose, by " + what,
              .x = {"pose", ""},
              .y = {"error", "m", false, 0.0, {}}};
  Plot degrees{.title = "Error of the turn against the pose, by " + what,
               .x = {"pose", ""},
               .y = {"error", "deg", false, 0.0, {}}};
  std::vector<Outcome> outcomes;
  for (const Setting& setting : settings) {
    context.report.Progress(what + " " + setting.label);
    slam::NdtDeOptions options = ThesisOptions(context.seed);
    options.evolution = setting.evolution;
    const SequenceErrors errors = MatchSequence(drive, options);
    const Distribution m = DistributionOf(errors.metres()), deg = DistributionOf(errors.degrees());
    table.Add({setting.label, setting.printed, Number(m.mean, 4), Number(m.p95, 4), Number(m.max, 3),
               Number(deg.mean, 3), Number(deg.max, 2), Count(errors.lost()),
               Number(DistributionOf(errors.fitness()).mean, 2), Number(errors.cpu_ms, 1)});
    Series series{.label = setting.label, .mark = Mark::kLine};
    for (std::size_t i = 0; i < errors.steps.size(); ++i) series.x.push_back(static_cast<double>(i + 1));
    series.y = errors.metres();
    metres.series.push_back(series);
    series.y = errors.degrees();
    degrees.series.push_back(series);
    outcomes.push_back({m.mean, errors.lost()});
  }
  context.report.Add(table, tag);
  context.report.Add(metres, tag + "_m");
  context.report.Add(degrees, tag + "_deg");
  return outcomes;
}

slam::EvolutionOptions With(int population, int generations) {
  slam::EvolutionOptions options;
  options.population = population;
  options.generations = generations;
  return options;
}

}  // namespace

void StudyEvolution(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Parameters of the evolution (5.1.1, Figures 5.1-5.4)");
  const ScanSequence drive = SimulatedDrive(context, 0.015);
  report.Text("A simulated drive of " + Count(static_cast<long long>(drive.scans.size())) +
              " poses with a range noise of 15 mm. (The thesis uses 366 poses in a world that it shows in a "
              "drawing, without its measures.) The evolution works alone, with F = 1, CR = 0.95 and the search "
              "space of Table 4.4.");

  const std::vector<Outcome> by_population = Sweep(context, drive,
                                                   {{"20", "does not converge", With(20, 50)},
                                                    {"40", "huge errors at some poses", With(40, 50)},
                                                    {"60", "few, smaller peaks", With(60, 50)},
                                                    {"100", "no large peaks", With(100, 50)}},
                                                   "population", "figures_5_1_5_2_population");
  const std::vector<Outcome> by_generations = Sweep(context, drive,
                                                    {{"15", "converges, imprecise", With(100, 15)},
                                                     {"30", "converges, imprecise", With(100, 30)},
                                                     {"50", "refined", With(100, 50)},
                                                     {"75", "refined further", With(100, 75)}},
                                                    "generations", "figures_5_3_5_4_generations");
  report.Heading("The ten strategies (2.4.6)");
  report.Text("The thesis lists the strategies but does not say which one it used.");
  std::vector<Setting> strategies;
  for (std::size_t i = 0; i < slam::kEvolutionStrategyNames.size(); ++i) {
    slam::EvolutionOptions evolution;
    evolution.strategy = static_cast<slam::EvolutionStrategy>(i);
    strategies.push_back({std::string(slam::kEvolutionStrategyNames[i]), "-", evolution});
  }
  Sweep(context, drive, strategies, "strategy", "strategies");

  const bool larger_is_surer = by_population.back().lost <= by_population.front().lost &&
                               by_population.back().mean_m < by_population.front().mean_m;
  const bool longer_is_finer = by_generations.back().mean_m < by_generations.front().mean_m;
  report.Expect(larger_is_surer, "a larger population does not lead to fewer failures, which contradicts the thesis");
  report.Expect(longer_is_finer, "more generations do not lead to smaller errors, which contradicts the thesis");
}

}  // namespace cairn::studies
