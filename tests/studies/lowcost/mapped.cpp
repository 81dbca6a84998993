#include "tests/studies/lowcost/mapped.h"

#include <cmath>
#include <complex>
#include <limits>
#include <numeric>
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

double TrajectoryError(const Trajectory& path, const Trajectory& truth, double late_s, bool scaled) {
  // Both at the stamps of the sparser one.
  const bool along_path = path.size() <= truth.size();
  std::vector<std::complex<double>> ours, theirs;
  const Stamp late = StampFromSeconds(late_s);
  for (const StampedPose& one : along_path ? path : truth) {
    const auto other = along_path ? PoseOn(truth, one.stamp - late, 2.0) : PoseOn(path, one.stamp + late, 2.0);
    if (!other) continue;
    const Pose2 &mine = along_path ? one.T_map_robot : *other, &its = along_path ? *other : one.T_map_robot;
    ours.emplace_back(mine.x, mine.y);
    theirs.emplace_back(its.x, its.y);
  }
  if (ours.size() < 3) return std::numeric_limits<double>::quiet_NaN();
  const auto n = static_cast<double>(ours.size());
  const auto centre = std::accumulate(ours.begin(), ours.end(), std::complex<double>{}) / n;
  const auto their_centre = std::accumulate(theirs.begin(), theirs.end(), std::complex<double>{}) / n;
  std::complex<double> product;
  double spread = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    product += std::conj(ours[i] - centre) * (theirs[i] - their_centre);
    spread += std::norm(ours[i] - centre);
  }
  const double size = scaled ? spread : std::abs(product);
  const std::complex<double> turn = size > 0.0 ? product / size : 1.0;
  for (std::size_t i = 0; i < ours.size(); ++i)
    squares += std::norm(theirs[i] - their_centre - turn * (ours[i] - centre));
  return std::sqrt(squares / n);
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
