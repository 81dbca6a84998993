// Tilted scans among level ones, from a robot that nods in a world with floor and ceiling. They must not
// change the planar estimate, they get poses, and the cloud made of them lies on the walls.
#include <gtest/gtest.h>

#include <iostream>

#include "client/sim/cloud_error.h"
#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/cloud/cloud_builder.h"
#include "server/slam/scan/beam_points.h"
#include "server/slam/scan_pipeline.h"

namespace cairn::slam {
namespace {

const double kLimit_rad = MapperOptions{}.max_tilt_rad;

struct Drive {
  std::vector<LogRecord> records;
  Trajectory truth;
  Pose2 start;
};

const Drive& NoddingDrive() {
  static const Drive drive = [] {
    sim::FleetOptions options;
    options.robots = 1;
    options.odometry_hz = 10;
    options.scan_hz = 5;
    options.laser.beams = 181;
    options.laser.field_of_view_rad = kPi;
    options.tilt = {
        .scans = 24, .first_rad = Radians(-60.0), .last_rad = Radians(40.0), .level_scans = 40, .halt = true};
    auto fleet = sim::Fleet::Create(*sim::OpenSurroundings("hall3d"), options);
    Drive result;
    result.start = fleet->T_map_robot_start(0);
    for (int i = 0; i < 1000; ++i) result.records.push_back(fleet->Next().record);
    result.truth = fleet->truth(0);
    return result;
  }();
  return drive;
}

struct Answers {
  std::vector<ScanOutcome> level, tilted;
  Trajectory path;  // Poses of all scans used.
  MapperSnapshot snapshot;
};

Answers RunOver(const Drive& drive, bool with_tilted, double max_tilt_rad = kLimit_rad) {
  Answers answers;
  MapperOptions options;
  options.filter.particles = 30;
  options.max_tilt_rad = max_tilt_rad;
  ScanPipeline pipeline(options, drive.start, SerialFor,
                        {[&](const Scan& scan, const ScanOutcome& outcome) {
                           (IsTilted(scan, kLimit_rad) ? answers.tilted : answers.level).push_back(outcome);
                           answers.path.push_back({scan.stamp, outcome.T_map_robot});
                         },
                         [](const Scan&, DropReason) { ADD_FAILURE() << "a scan was dropped"; }});
  for (const LogRecord& record : drive.records) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      pipeline.Add(*odometry);
    } else if (const auto& scan = std::get<Scan>(record); with_tilted || !IsTilted(scan, kLimit_rad)) {
      pipeline.Add(std::make_shared<const Scan>(scan));
    }
  }
  pipeline.Finish();
  answers.snapshot = pipeline.mapper().Snapshot();
  return answers;
}

TEST(TiltedScans, ChangeNothingThatLevelScansSay) {
  const Answers with = RunOver(NoddingDrive(), true), without = RunOver(NoddingDrive(), false);
  ASSERT_EQ(with.level.size(), without.level.size());
  ASSERT_GT(with.tilted.size(), 80u);
  for (std::size_t i = 0; i < with.level.size(); ++i) {
    EXPECT_EQ(with.level[i].T_map_robot, without.level[i].T_map_robot) << i;
    EXPECT_EQ(with.level[i].keyframe, without.level[i].keyframe);
    EXPECT_EQ(with.level[i].score, without.level[i].score);
  }
  ASSERT_EQ(with.snapshot.keyframes.size(), without.snapshot.keyframes.size());
  for (const Keyframe& keyframe : with.snapshot.keyframes) EXPECT_FALSE(IsTilted(*keyframe.scan, kLimit_rad));
}

TEST(TiltedScans, GetAPoseFromOdometryAndSaySo) {
  const Drive& drive = NoddingDrive();
  const Answers run = RunOver(drive, true);
  for (const ScanOutcome& outcome : run.tilted) {
    EXPECT_FALSE(outcome.keyframe);
    EXPECT_TRUE(outcome.localized);
    EXPECT_EQ(outcome.reason, PoseReason::kOdometryOnly);
    EXPECT_TRUE(IsCovariance(outcome.covariance));
    const auto truth = PoseOn(drive.truth, outcome.stamp, 1.0);
    ASSERT_TRUE(truth);
    EXPECT_LT((outcome.T_map_robot.translation() - truth->translation()).norm(), 0.1);
  }
  // The whole path has a place for every scan, tilted ones too.
  EXPECT_EQ(run.snapshot.FullTrajectory().size(), run.level.size() + run.tilted.size());
}

// The reason for the limit: without it, the floor and the ceiling that tilted scans see are taken for walls.
TEST(TiltedScans, WouldMisleadTheEstimatorWithoutTheLimit) {
  const Drive& drive = NoddingDrive();
  const auto worst = [&](double max_tilt_rad) {
    double error = 0.0;
    for (const StampedPose& pose : RunOver(drive, true, max_tilt_rad).path) {
      const auto truth = PoseOn(drive.truth, pose.stamp, 1.0);
      if (truth) error = std::max(error, (pose.T_map_robot.translation() - truth->translation()).norm());
    }
    return error;
  };
  const double misled = worst(1.57), guarded = worst(kLimit_rad);
  std::cout << "worst position error " << guarded << " m, without the limit " << misled << " m\n";
  EXPECT_GT(misled, 1.5 * guarded);
}

TEST(TiltedScans, BeforeTheFirstLevelScanNobodyKnows) {
  MapperOptions options;
  Mapper mapper(options, {1, 2, 0.5}, 1);
  for (const LogRecord& record : NoddingDrive().records) {
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr || !IsTilted(*scan, kLimit_rad)) continue;
    const ScanOutcome outcome = mapper.Process(std::make_shared<const Scan>(*scan), {}, SerialFor);
    EXPECT_FALSE(outcome.localized);
    EXPECT_EQ(outcome.reason, PoseReason::kWaiting);
    EXPECT_EQ(outcome.T_map_robot, (Pose2{1, 2, 0.5}));
    break;
  }
  EXPECT_TRUE(mapper.Snapshot().keyframes.empty());
}

TEST(TiltedScans, StayWhereTheLevelOneWasIfOdometryIsWithheld) {
  MapperOptions options;
  options.front_end.use_odometry = false;
  Mapper mapper(options, {1, 2, 0.5}, 1);
  const auto scan_where = [](bool tilted) {
    for (const LogRecord& record : NoddingDrive().records)
      if (const auto* scan = std::get_if<Scan>(&record); scan != nullptr && IsTilted(*scan, kLimit_rad) == tilted)
        return std::make_shared<const Scan>(*scan);
    return std::shared_ptr<const Scan>();
  };
  static_cast<void>(mapper.Process(scan_where(false), {}, SerialFor));
  const ScanOutcome outcome = mapper.Process(scan_where(true), {7, 8, 1}, SerialFor);
  EXPECT_EQ(outcome.reason, PoseReason::kOdometryOnly);
  EXPECT_EQ(outcome.T_map_robot, (Pose2{1, 2, 0.5}));
}

// Stated bounds: with true poses the cloud's error is the laser's noise; with the estimator's, under 3 cm on
// average.
TEST(Cloud, LiesOnTheWallsOfTheSimulatedBuilding) {
  const Drive& drive = NoddingDrive();
  const sim::RectangleTree truth(sim::OpenWorld3("hall3d")->rectangles);
  const Answers run = RunOver(drive, true);
  const auto error = [&](const Trajectory& path, bool wrong_sign) {
    CloudBuilder builder(path, {.height_m = sim::LaserOptions{}.height_m});
    for (const LogRecord& record : drive.records) {
      const auto* scan = std::get_if<Scan>(&record);
      if (scan == nullptr) continue;
      Scan turned = *scan;
      if (wrong_sign) turned.tilt_rad = -turned.tilt_rad;
      EXPECT_TRUE(builder.Add(turned));
    }
    EXPECT_GT(builder.scans_tilted(), 80);
    return sim::MeasureCloud(builder.cloud(), truth);
  };
  const sim::CloudError best = error(drive.truth, false), ours = error(run.path, false);
  std::cout << "wall error with true poses: mean " << best.mean_m << " m, p95 " << best.p95_m
            << "; with the estimator's: mean " << ours.mean_m << " m, rms " << ours.rms_m << ", p95 " << ours.p95_m
            << ", " << ours.points << " points\n";
  EXPECT_GT(best.points, 30000u);
  EXPECT_LT(best.mean_m, 0.012);
  EXPECT_LT(ours.mean_m, 0.03);
  EXPECT_GT(error(drive.truth, true).mean_m, 0.1) << "the measure sees a wrong sign of the tilt";
}

}  // namespace
}  // namespace cairn::slam
