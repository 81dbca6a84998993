#include "tests/studies/lowcost/mapped.h"

#include <cmath>
#include <limits>
#include <optional>

#include "server/slam/calibration/odometry_path.h"
#include "server/slam/grid/grid_image.h"
#include "server/slam/scan/deskew.h"
#include "server/slam/smoothing/smoothed_map.h"

namespace cairn::studies {
namespace {

std::vector<Odometry> OdometryOf(const StudyLog& log) {
  std::vector<Odometry> samples;
  for (const LogRecord& record : log.records)
    if (const auto* odometry = std::get_if<Odometry>(&record)) samples.push_back(*odometry);
  return samples;
}

}  // namespace

Trajectory RawPath(const StudyLog& log) {
  const slam::OdometryPath odometry(OdometryOf(log), {});
  Trajectory path;
  std::optional<Pose2> T_odom_start;
  for (const LogRecord& record : log.records) {
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr) continue;
    const auto T_odom_robot = odometry.At(scan->stamp);
    if (!T_odom_robot) continue;
    if (!T_odom_start) T_odom_start = *T_odom_robot;
    path.push_back({scan->stamp, log.T_map_robot_start * Between(*T_odom_start, *T_odom_robot)});
  }
  return path;
}

StudyLog AllAtOnce(const StudyLog& log, const slam::PairingOptions& pairing) {
  std::vector<Odometry> samples = OdometryOf(log);
  for (Odometry& sample : samples) sample.stamp += StampFromSeconds(pairing.laser_lag_s);
  const slam::OdometryPath odometry(samples, pairing.wheels);
  StudyLog still;
  for (const LogRecord& record : log.records) {
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr) continue;
    const auto during = odometry.Covering(scan->stamp, scan->stamp + static_cast<Stamp>(slam::DurationNs(*scan)));
    still.records.emplace_back(scan->beam_period_s > 0.0 && !during.empty() ? slam::Deskew(*scan, during) : *scan);
  }
  return still;
}

double LengthOf(const Trajectory& path) {
  double length = 0.0;
  std::optional<Eigen::Vector2d> last;
  for (const StampedPose& pose : path) {
    const Eigen::Vector2d p = pose.T_map_robot.translation();
    if (last && (p - *last).norm() < 0.1) continue;
    if (last) length += (p - *last).norm();
    last = p;
  }
  return length;
}

double RmsError(const Trajectory& path, const Trajectory& truth, double late_s) {
  double squares = 0.0;
  std::size_t count = 0;
  for (const StampedPose& pose : path) {
    const auto at = PoseOn(truth, pose.stamp - StampFromSeconds(late_s), 1.0);
    if (!at) continue;
    squares += (pose.T_map_robot.translation() - at->translation()).squaredNorm();
    ++count;
  }
  return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : std::numeric_limits<double>::quiet_NaN();
}

Mapped MapLog(const StudyContext& context, const StudyLog& log, slam::MapperOptions options) {
  options.seed = static_cast<std::int64_t>(context.seed);
  Mapped mapped{RunOverLog(log, options), {}, {}};
  const auto smoothed = slam::SmoothMap(mapped.run.snapshot, options.grid, [] { return true; });
  mapped.smoothed = mapped.run.snapshot.TrajectoryAlong(smoothed->path);
  mapped.map = slam::ImageOf(smoothed->grid);
  return mapped;
}

}  // namespace cairn::studies
