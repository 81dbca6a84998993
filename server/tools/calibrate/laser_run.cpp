#include "server/tools/calibrate/laser_run.h"

#include <cmath>
#include <iomanip>
#include <memory>
#include <sstream>

#include "common/bag/recording.h"
#include "server/slam/mapper_options.h"
#include "server/slam/scan/beam_points.h"
#include "server/tools/log_run/over_threads.h"

namespace cairn::server {
namespace {

// Differences of two such stamps fit into an int64.
constexpr Stamp kLatestStamp = std::int64_t{1} << 61;

bool IsPlausible(Stamp stamp) {
  return stamp > -kLatestStamp && stamp < kLatestStamp;
}

// The command line that reads the log with what was found.
std::string LogOptionsOf(const LaserReport& report) {
  const slam::LaserFit& fit = report.fit;
  std::ostringstream out;
  if (fit.turn.shown()) {
    constexpr const char* kPlaces[] = {"first", "middle", "last"};
    out << " --scan-period " << std::setprecision(3) << *fit.timing.scan_period_s << " --stamp-at "
        << kPlaces[static_cast<std::size_t>(fit.timing.stamp_at.value_or(StampAt::kFirst))]
        << (fit.timing.clockwise.value_or(false) ? " --clockwise" : " --counter-clockwise");
    if (fit.timing.turn_from_rad) out << " --turn-from " << std::llround(Degrees(*fit.timing.turn_from_rad));
  }
  using enum slam::LaserUnknown;
  const slam::MountingFit& mounting = fit.mounting;
  if (mounting.Shows(kX) || mounting.Shows(kY) || mounting.Shows(kHeading)) {
    const Pose2& T = mounting.T_robot_laser;
    out << std::fixed << std::setprecision(3) << " --laser-at " << T.x << ',' << T.y << ',' << std::setprecision(4)
        << T.theta;
  }
  return out.str().empty() ? std::string() : out.str().substr(1);
}

}  // namespace

Result<LaserReport> RunLaser(const LaserRunOptions& options) {
  LaserReport report;
  slam::LaserLog log;
  LogReaderOptions reader = options.reader;
  reader.timing = {};
  reader.timing.scan_period_s = 0.0;  // Scans as they stand in the log.
  const slam::MapperOptions estimator;
  std::optional<Stamp> last_scan, last_odometry;
  const auto read = ReadRecording(options.log, reader, [&](LogRecord&& record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      if (ValidateOdometry(*odometry) && IsPlausible(odometry->stamp) &&
          (!last_odometry || odometry->stamp > *last_odometry)) {
        log.odometry.push_back(*odometry);
        last_odometry = odometry->stamp;
      }
      return true;
    }
    auto scan = std::make_shared<const Scan>(std::move(std::get<Scan>(record)));
    ++report.scans;
    if (!ValidateScan(*scan) || slam::IsTilted(*scan, estimator.max_tilt_rad) || !IsPlausible(scan->stamp) ||
        (last_scan && scan->stamp <= *last_scan)) {
      ++report.unusable_scans;
      return true;
    }
    last_scan = scan->stamp;
    log.scans.push_back(std::move(scan));
    return log.scans.size() < static_cast<std::size_t>(options.max_scans);
  });
  if (!read) return tl::unexpected(read.error());
  if (log.scans.empty() || log.odometry.empty())
    return Fail(StatusCode::kFailedPrecondition, options.log.string() + ": scans and odometry are needed");
  report.T_robot_laser_logged = log.scans.front()->T_robot_laser;
  auto fit = slam::FitLaser(log, options.fit, OverThreads(options.threads));
  if (!fit) return Fail(fit.error().code, options.log.string() + ": " + fit.error().message);
  report.fit = *std::move(fit);
  report.log_options = LogOptionsOf(report);
  return report;
}

}  // namespace cairn::server
