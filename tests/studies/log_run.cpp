#include "tests/studies/log_run.h"

#include <cstddef>
#include <memory>

#include "server/slam/grid/grid_image.h"
#include "server/slam/scan_pipeline.h"

namespace cairn::studies {

LogRun RunOverLog(const StudyLog& log, const slam::MapperOptions& options) {
  LogRun run;
  Stopwatch watch;
  const double user_before = UserCpuSeconds();
  slam::ScanPipeline pipeline(options, log.T_map_robot_start, slam::SerialFor,
                              {.used =
                                   [&](const Scan& scan, const slam::ScanOutcome& outcome) {
                                     run.scan_cpu_ms.push_back(watch.CpuMs());
                                     run.scan_wall_ms.push_back(watch.WallMs());
                                     run.online.push_back({scan.stamp, outcome.T_map_robot});
                                     run.covariances.push_back(outcome.covariance);
                                     run.keyframes += outcome.keyframe ? 1 : 0;
                                     run.not_localized += outcome.localized ? 0 : 1;
                                     run.localized.push_back(outcome.localized ? 1 : 0);
                                     ++run.reasons[static_cast<std::size_t>(outcome.reason)];
                                     watch.Restart();
                                   },
                               .dropped = [&](const Scan&, DropReason) { ++run.scans_dropped; }});
  for (const LogRecord& record : log.records) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      watch.Restart();
      if (ValidateOdometry(*odometry)) pipeline.Add(*odometry);
      continue;
    }
    auto scan = std::make_shared<const Scan>(std::get<Scan>(record));
    watch.Restart();
    if (!ValidateScan(*scan))
      ++run.scans_dropped;
    else
      pipeline.Add(std::move(scan));
  }
  watch.Restart();
  pipeline.Finish();
  run.user_cpu_s = UserCpuSeconds() - user_before;
  run.snapshot = pipeline.mapper().Snapshot();
  run.full = run.snapshot.FullTrajectory();
  run.learned = pipeline.mapper().learned();
  run.landmarks = pipeline.mapper().landmarks().size();
  return run;
}

OccupancyImage MapOf(const LogRun& run, WhichPath path, const slam::GridOptions& options) {
  slam::OccupancyGrid grid(options);
  const std::vector<Pose2>& poses = path == WhichPath::kOnline ? run.snapshot.online_path : run.snapshot.full_path;
  for (std::size_t k = 0; k < run.snapshot.keyframes.size() && k < poses.size(); ++k)
    grid.Draw(*run.snapshot.keyframes[k].scan, poses[k]);
  return slam::ImageOf(grid);
}

}  // namespace cairn::studies
