// The smallest whole study, and a smoke test of everything a study may use: how far odometry alone drifts on
// a simulated drive, and one map. Copy this file to begin a new one.
#include "tests/studies/log_run.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

Trajectory OdometryOf(const StudyLog& log) {
  Trajectory path;
  for (const LogRecord& record : log.records)
    if (const auto* odometry = std::get_if<Odometry>(&record))
      path.push_back({odometry->stamp, log.T_map_robot_start * odometry->T_odom_robot});
  return path;
}

void RunExample(StudyContext& context) {
  Report& report = context.report;
  sim::FleetOptions options;
  options.seed = context.seed;
  const StudyLog log = SimulateLog("building", context.Pick(120.0, 30.0), options);
  report.Text("A robot drives through the simulated building; odometry alone, and the estimator.");

  slam::MapperOptions mapper;
  mapper.filter.particles = 50;
  mapper.seed = static_cast<std::int64_t>(context.seed);
  const LogRun run = RunOverLog(log, mapper);
  const Trajectory odometry = OdometryOf(log);
  Table table({"path", "mean error (m)", "max (m)", "mean error (deg)"});
  const RelationError without = ErrorOf(odometry, log.relations), with = ErrorOf(run.online, log.relations);
  for (const auto& [name, error] : {std::pair{"odometry", without}, std::pair{"estimator, online", with}})
    table.Add({name, Number(error.trans_mean_m, 4), Number(error.trans_max_m, 3), Number(error.rot_mean_deg, 3)});
  report.Add(table, "errors");

  Plot map{.title = "Simulated building", .x = {"x", "m"}, .y = {"y", "m"}};
  map.series = {PathSeries(log.truth, "truth"), PathSeries(odometry, "odometry"), PathSeries(run.online, "estimator")};
  report.AddMap(MapOf(run, WhichPath::kFull, mapper.grid), map, "map");

  Plot time{.title = "Time per scan", .x = {"scan", ""}, .y = {"processor time", "ms", true}};
  Series series{.label = "estimator", .y = run.scan_cpu_ms, .mark = Mark::kPoints};
  for (std::size_t i = 0; i < run.scan_cpu_ms.size(); ++i) series.x.push_back(static_cast<double>(i));
  time.series = {series};
  time.bounds = {{run.time_ms().mean, "mean"}};
  report.Add(time, "time");

  report.Expect(with.trans_mean_m < without.trans_mean_m && with.trans_mean_m < 0.05,
                "the estimator is not clearly better than odometry");
}

const Registration kRegistered{
    "example", "an example of a study: odometry alone compared with the estimator, simulated", RunExample};

}  // namespace
}  // namespace cairn::studies
