// cairn-study consistency tests whether the stated uncertainty of the whole mapper is right. It prints the NEES of the
// reported poses over 100 runs in each of five simulated worlds, in four of them with a cheap lidar as well, whatever
// the result is. Then it does the same for the verified relations of real logs.
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/studies/log_run.h"
#include "tests/studies/logs.h"
#include "tests/studies/mapper/mapper_consistency.h"
#include "tests/studies/mapper/relation_coverage.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

std::string VerdictOf(const MapperConsistency& result) {
  if (result.whole.nees > result.nees_high) return "overconfident";
  return result.whole.nees < result.nees_low ? "underconfident" : "consistent";
}

// The recall of places that were seen again, and of how many chances.
std::string SeenAgainOf(const SeenAgain& seen) {
  if (seen.chances == 0) return "-";
  const double share = static_cast<double>(seen.found) / static_cast<double>(seen.chances);
  return Percent(share, 0) + " of " + Count(static_cast<long long>(seen.chances));
}

using Figure = double MapperConsistencyPoint::*;

Series SeriesOf(const MapperConsistency& result, const std::string& label, Figure figure) {
  Series series{.label = label, .mark = Mark::kLine};
  for (const MapperConsistencyPoint& point : result.points) {
    series.x.push_back(point.travelled_m);
    series.y.push_back(point.*figure);
  }
  return series;
}

void CompareRelations(StudyContext& context) {
  if (!context.Wants("relations")) return;
  Report& report = context.report;
  Table table({"log", "poses", "relations", "inside 95 %", "NEES (3)", "median (2.37)", "of (x, y) (2)",
               "of heading (1)", "mean error (m)"});
  for (const char* name : {"intel", "mit-csail", "mit-killian"}) {
    const auto log = OpenRealLog(context, name, context.Pick(0, 300));
    if (!log) continue;
    slam::MapperOptions mapper;
    mapper.seed = static_cast<std::int64_t>(context.seed);
    const LogRun run = RunOverLog(*log, mapper);
    const RelationNoise noise = RelationNoiseOf(*log);
    report.Text(std::string(name) + ": the relations themselves are taken as exact to " +
                Number(1e3 * noise.sigma_m, 1) + " mm and " + Number(Degrees(noise.sigma_rad), 2) + " degrees.");
    const auto add = [&](const std::string& poses, const RelationCoverage& coverage, const std::string& mean_error) {
      table.Add({name, poses, Count(static_cast<int>(coverage.compared)), Percent(coverage.inside),
                 Number(coverage.nees, 2), Number(coverage.nees_median, 2), Number(coverage.position_nees, 2),
                 Number(coverage.heading_nees, 2), mean_error});
    };
    const auto mean_error = [&](const Trajectory& trajectory) {
      return Number(ErrorOf(trajectory, log->relations).trans_mean_m, 4);
    };
    add("steps alone", CoverageOfSteps(run, *log, noise), "-");
    add("online, each by itself", CoverageOfOnline(run, *log, noise), mean_error(run.online));
    add("smoothed, together", CoverageOfSmoothed(run, *log, noise),
        mean_error(run.snapshot.TrajectoryAlong(slam::SmoothedPath(run.snapshot))));
  }
  report.Text(
      "The verified relations of real logs, compared with the stated uncertainty of one pose relative to another: "
      "of the steps between keyframes alone, over at most 30 m; online of two poses that are taken for independent, "
      "smoothed of the joint uncertainty of the fitted path.");
  report.Add(table, "relations inside");
}

void RunConsistency(StudyContext& context) {
  Report& report = context.report;
  const int runs = context.runs > 0 ? context.runs : context.Pick(100, 4);
  report.Text(
      "This study tests the uncertainty that the mapper states: " + Count(runs) +
      " runs of the default mapper in each world, with different wheels, slip, laser noise and seeds, "
      "are compared with the truth every 3 m of the way. A consistent mapper has a mean NEES of 3 and "
      "a median of 2.37, and 95 % of its single poses lie inside the 95 % region. A larger NEES means "
      "that the stated uncertainty is too small (overconfident). The bounds are those of the mean of independent runs "
      "at one place of the way.");
  Table table({"world", "way (m)", "NEES (3)", "95 % bounds", "median (2.37)", "inside 95 %", "of (x, y) (2)",
               "of heading (1)", "error (m)", "reported (m)", "error (deg)", "reported (deg)", "singular",
               "not localized", "seen again", "wrong", ""});
  const Axis way{.label = "travelled", .unit = "m"};
  Plot nees{.title = "NEES of the mapper's pose", .x = way, .y = {"NEES of (x, y, heading)", "", true}};
  Plot inside{
      .title = "Single poses inside the 95 % region", .x = way, .y = {"share of the runs", "", false, 0.0, 1.0}};
  inside.bounds = {{0.95, "consistent"}};
  const double seconds = context.Pick(90.0, 40.0);
  std::vector<ConsistencyDrive> drives = ConsistencyDrives(seconds);
  for (const ConsistencyDrive& drive : ConsistencyDrives(seconds)) drives.push_back(WithCheapLidar(drive));
  drives.push_back(NichesDrive(3.0 * seconds));
  for (const ConsistencyDrive& drive : drives) {
    const std::string& name = drive.world.name;
    if (!context.Wants(name)) continue;
    MapperConsistencyOptions options;
    options.runs = runs;
    options.first_seed = context.seed;
    const MapperConsistency result = StudyMapperConsistency(drive, options, [&](int done) {
      if (done % 20 == 0) report.Progress(name + ": " + Count(done) + " runs");
    });
    if (result.points.empty()) {
      report.Fault(name + ": no pose could be compared");
      continue;
    }
    const MapperConsistencyPoint& whole = result.whole;
    table.Add({name, Number(result.points.back().travelled_m, 0), Number(whole.nees, 2),
               Number(result.nees_low, 2) + " .. " + Number(result.nees_high, 2), Number(whole.nees_median, 2),
               Percent(whole.inside), Number(whole.position_nees, 2), Number(whole.heading_nees, 2),
               Number(whole.position_error_m, 3), Number(whole.position_sigma_m, 3),
               Number(Degrees(whole.heading_error_rad), 3), Number(Degrees(whole.heading_sigma_rad), 3),
               Percent(whole.singular), Percent(whole.not_localized), SeenAgainOf(result.seen_again),
               Count(static_cast<long long>(result.seen_again.wrong)), VerdictOf(result)});
    nees.series.push_back(SeriesOf(result, name, &MapperConsistencyPoint::nees));
    nees.bounds = {{result.nees_low, "95 %"}, {result.nees_high, "95 %"}};
    inside.series.push_back(SeriesOf(result, name, &MapperConsistencyPoint::inside));
    if (result.seen_again.wrong > 0)
      report.Fault(Count(static_cast<long long>(result.seen_again.wrong)) + " wrong relations to old places in " +
                   name);
    if (VerdictOf(result) != "consistent") report.Warn("the mapper is " + VerdictOf(result) + " in " + name + ".");
  }
  report.Add(table, "mapper consistency");
  report.Add(nees, "mapper nees");
  report.Add(inside, "mapper inside");
  CompareRelations(context);
}

const Registration kRegistered{"consistency",
                               "NEES of the whole mapper over 100 runs in each of five worlds, relations of real logs",
                               RunConsistency};

}  // namespace
}  // namespace cairn::studies
