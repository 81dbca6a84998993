#include <algorithm>
#include <cmath>

#include "client/sim/cloud_error.h"
#include "client/sim/fleet.h"
#include "client/sim/laser_models.h"
#include "client/sim/shipped_worlds.h"
#include "common/cloud/cloud_builder.h"
#include "common/cloud/cloud_file.h"
#include "common/sensor/log_record.h"
#include "server/slam/scan_pipeline.h"
#include "tests/studies/calibration/calibration.h"

namespace cairn::studies {
namespace {

struct Drive {
  std::vector<LogRecord> records;
  Trajectory truth, estimate;
};

Drive NodThrough(const sim::FleetOptions& options, double seconds) {
  Drive drive;
  auto fleet = sim::Fleet::Create(sim::SurroundingsOf(*sim::OpenWorld3("hall3d")), options);
  slam::MapperOptions mapper;
  slam::ScanPipeline pipeline(mapper, fleet->T_map_robot_start(0), slam::SerialFor,
                              {[&](const Scan& scan, const slam::ScanOutcome& outcome) {
                                 drive.estimate.push_back({scan.stamp, outcome.T_map_robot});
                               },
                               [](const Scan&, DropReason) {}});
  const Stamp end = options.first_stamp + StampFromSeconds(seconds);
  for (;;) {
    LogRecord record = fleet->Next().record;
    if (std::visit([](const auto& value) { return value.stamp; }, record) > end) break;
    if (const auto* odometry = std::get_if<Odometry>(&record)) pipeline.Add(*odometry);
    if (const auto* scan = std::get_if<Scan>(&record)) pipeline.Add(std::make_shared<const Scan>(*scan));
    drive.records.push_back(std::move(record));
  }
  pipeline.Finish();
  drive.truth = fleet->truth(0);
  return drive;
}

PointCloud CloudOf(const Drive& drive, const Trajectory& path, double height_m) {
  CloudBuilder builder(path, {.height_m = height_m});
  for (const LogRecord& record : drive.records)
    if (const auto* scan = std::get_if<Scan>(&record))
      if (!builder.Add(*scan)) break;
  return builder.cloud();
}

// Mean size of the range errors that the maker of the laser states, over the hits of a drive. With true
// poses, the distance of a point from the walls is never larger than the error of its range.
double StatedError(const Drive& drive, const sim::RangeError& error) {
  const double mean_share = error.kind == sim::RangeErrorKind::kSigma ? std::sqrt(2.0 / kPi) : 0.5;
  double sum = 0.0, hits = 0.0;
  for (const LogRecord& record : drive.records) {
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr) continue;
    for (const float range : scan->ranges_m) {
      if (!std::isfinite(range) || range <= 0.0F) continue;
      sum += mean_share * sim::ErrorScale(error, range);
      ++hits;
    }
  }
  return hits > 0.0 ? sum / hits : 0.0;
}

// Mean distance of a path's poses from the true ones.
double PoseError(const Trajectory& path, const Trajectory& truth) {
  double sum = 0.0, poses = 0.0;
  for (const StampedPose& pose : path) {
    const auto there = std::ranges::lower_bound(truth, pose.stamp, {}, &StampedPose::stamp);
    if (there == truth.end() || there->stamp != pose.stamp) continue;
    sum += (pose.T_map_robot.translation() - there->T_map_robot.translation()).norm();
    ++poses;
  }
  return poses > 0.0 ? sum / poses : 0.0;
}

constexpr double kPosesM = 0.025;  // The mean error that the poses of the estimator may add ...
constexpr double kFarM = 8.0;      // ... with a scanner of at least this range.

}  // namespace

void StudyCloud(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Clouds of a simulated building");
  report.Text(
      "A robot drives through hall3d, stops from time to time, and then tilts its scanner step by step "
      "from 60 deg up to 45 deg down. The table shows the distance of the points of the cloud from the "
      "nearest true rectangle, once with the true poses, so that only the laser has errors, and once "
      "with the online poses of the estimator. With the true poses the mean distance must not be "
      "larger than the mean range error that the maker of the scanner states. With the poses of the "
      "estimator it may be 2.5 cm more, for scanners with a range of at least 8 m. The URG-04LX (4 m) "
      "and its variant UG01 (5.6 m) do not always see the walls of the hall, so their poses drift, and "
      "the stated error of the laser gives no bound. Their clouds with estimated poses are therefore "
      "printed beside the error of the poses and are not checked.");
  const sim::RectangleTree truth(sim::OpenWorld3("hall3d")->rectangles);
  Table table({"scanner", "poses", "points", "mean (m)", "rms (m)", "median (m)", "p95 (m)", "max (m)",
               "bound of the mean (m)", "mean error of the poses (m)"});
  for (const std::string model : {"thesis", "lms200", "lms291-s05", "urg-04lx", "urg-04lx-ug01"}) {
    sim::FleetOptions options;
    options.robots = 1;
    options.seed = context.seed;
    options.scan_hz = 5;
    options.laser = sim::WithModel(options.laser, model)->laser;
    options.tilt = {
        .scans = 36, .first_rad = Radians(-60.0), .last_rad = Radians(45.0), .level_scans = 60, .halt = true};
    const Drive drive = NodThrough(options, context.Pick(300.0, 40.0));
    const double stated = StatedError(drive, options.laser.error);
    for (const auto& [name, path] : {std::pair{"true", &drive.truth}, std::pair{"estimated", &drive.estimate}}) {
      const PointCloud cloud = CloudOf(drive, *path, options.laser.height_m);
      const sim::CloudError e = sim::MeasureCloud(cloud, truth);
      const bool estimated = path == &drive.estimate;
      double bound = stated;
      if (estimated) bound = options.laser.range_max_m >= kFarM ? stated + kPosesM : NAN;
      table.Add({model, name, Count(static_cast<long long>(e.points)), Number(e.mean_m, 4), Number(e.rms_m, 4),
                 Number(e.median_m, 4), Number(e.p95_m, 4), Number(e.max_m, 3), Number(bound, 4),
                 Number(PoseError(*path, drive.truth), 3)});
      report.Expect(std::isnan(bound) || e.mean_m <= bound,
                    model + ", " + name + " poses: the mean distance of the cloud from the walls exceeds its bound");
      if (model == "lms200" && estimated) {
        if (!report.directory().empty())
          if (const auto written = WriteCloud(cloud, CloudFormat::kPly, report.directory() / "hall3d.ply"); !written)
            report.Warn(written.error().message);
      }
    }
  }
  report.Add(table, "cloud");
}

}  // namespace cairn::studies
