// A robot with a lidar that turns slowly, and wheels that say nothing or too little of its turns: the motion within a
// scan comes from the forecast, and from what the match shows.
#include "server/slam/tracking/scan_tracking.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <variant>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/sensor/trajectory.h"
#include "server/slam/scan_pipeline.h"

namespace cairn::slam {
namespace {

struct Rolling {
  std::vector<LogRecord> records;
  Trajectory truth;
  Pose2 T_map_robot_start;
};

// Every turn of the odometry is multiplied by `turn_share`.
Rolling Drive(double turn_share) {
  sim::FleetOptions options;
  options.robots = 1;
  options.seed = 4;
  options.scan_hz = 5.0;
  options.laser.beams = 240;
  options.laser.field_of_view_rad = 2.0 * kPi;
  options.laser.range_max_m = 10.0;
  options.laser.sweep_s = 0.19;
  auto fleet = sim::Fleet::Create(*sim::OpenWorld("building"), options);
  Rolling drive;
  std::optional<Pose2> last;
  Pose2 T_odom_robot;
  for (Stamp stamp = 0; stamp < options.first_stamp + StampFromSeconds(100.0);) {
    LogRecord record = fleet->Next().record;
    stamp = std::visit([](const auto& value) { return value.stamp; }, record);
    if (auto* odometry = std::get_if<Odometry>(&record)) {
      const Pose2 step = last ? Between(*last, odometry->T_odom_robot) : Pose2{};
      last = odometry->T_odom_robot;
      T_odom_robot = T_odom_robot * Pose2{step.x, step.y, turn_share * step.theta};
      odometry->T_odom_robot = T_odom_robot;
    }
    drive.records.push_back(std::move(record));
  }
  drive.truth = fleet->truth(0);
  drive.T_map_robot_start = fleet->T_map_robot_start(0);
  return drive;
}

// Root mean square of the distance from the truth, in m.
double Error(const Rolling& drive, bool use_odometry, bool say_times) {
  MapperOptions options;
  options.front_end.use_odometry = use_odometry;
  double sum = 0.0;
  int scans = 0;
  ScanPipeline pipeline(options, drive.T_map_robot_start, SerialFor,
                        {[&](const Scan& scan, const ScanOutcome& outcome) {
                           const auto truth = PoseOn(drive.truth, scan.stamp, 1.0);
                           if (!truth) return;
                           sum += Between(*truth, outcome.T_map_robot).translation().squaredNorm();
                           ++scans;
                         },
                         [](const Scan&, DropReason) {}});
  for (const LogRecord& record : drive.records) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      pipeline.Add(*odometry);
    } else {
      auto scan = std::make_shared<Scan>(std::get<Scan>(record));
      if (!say_times) scan->beam_period_s = 0.0;
      pipeline.Add(std::move(scan));
    }
  }
  pipeline.Finish();
  EXPECT_GT(scans, 250);
  return std::sqrt(sum / scans);
}

TEST(ScanTracking, WithoutOdometryTheMotionWithinAScanComesFromTheForecast) {
  const Rolling drive = Drive(1.0);
  const double told = Error(drive, false, true), untold = Error(drive, false, false);
  std::printf("error without odometry: %.3f m, with beams taken for simultaneous %.3f\n", told, untold);
  EXPECT_LT(told, 0.5 * untold);
}

TEST(ScanTracking, TheMatchCorrectsOdometryThatMissesTurns) {
  const Rolling drive = Drive(0.0);
  const double told = Error(drive, true, true), untold = Error(drive, true, false);
  std::printf("error with odometry without turns: %.3f m, with beams taken for simultaneous %.3f\n", told, untold);
  EXPECT_LT(told, 0.7 * untold);
}

}  // namespace
}  // namespace cairn::slam
