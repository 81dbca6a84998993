#include "client/cli/trajectory_crispness.h"

#include <cmath>
#include <cstdint>
#include <variant>

#include "client/cli/interrupt.h"
#include "common/bag/recording.h"
#include "common/cloud/cloud_builder.h"

namespace cairn::client {
namespace {

tl::unexpected<Status> Stopped() {
  return Fail(StatusCode::kCancelled, "interrupted");
}

// Puts a scan down. Where its beams were measured one after the other while the robot moved, each is put down as a scan
// of its own, at its own time.
Result<void> Place(const Scan& scan, CloudBuilder& builder) {
  if (scan.beam_period_s == 0.0) return builder.Add(scan);
  Scan beam = scan;
  for (std::size_t i = 0; i < scan.ranges_m.size(); ++i) {
    const auto n = static_cast<double>(i);
    // Without overflow, for stamps a broken clock may place anywhere in int64.
    beam.stamp = static_cast<Stamp>(static_cast<std::uint64_t>(scan.stamp) +
                                    static_cast<std::uint64_t>(StampFromSeconds(n * scan.beam_period_s)));
    beam.angle_first_rad = scan.angle_first_rad + n * scan.angle_step_rad;
    beam.ranges_m.assign(1, scan.ranges_m[i]);
    if (auto added = builder.Add(beam); !added) return added;
  }
  return {};
}

}  // namespace

Result<Trajectory> ReadOdometry(const std::string& log, const LogReaderOptions& reader) {
  Trajectory path;
  const auto read = ReadRecording(log, reader, [&path](LogRecord&& record) {
    const auto* odometry = std::get_if<Odometry>(&record);
    if (odometry != nullptr && ValidateOdometry(*odometry) && (path.empty() || odometry->stamp > path.back().stamp))
      path.push_back({odometry->stamp, odometry->T_odom_robot});
    return !Interrupted();
  });
  if (!read) return tl::unexpected(read.error());
  if (Interrupted()) return Stopped();
  if (path.empty()) return Fail(StatusCode::kFailedPrecondition, log + " has no odometry: give a trajectory");
  return path;
}

Result<TrajectoryCrispness> MeasureCrispness(const std::string& log, const LogReaderOptions& reader,
                                             const Trajectory& trajectory, const CrispnessOptions& options) {
  constexpr double kLongestGap_s = 0.5, kLevel_rad = 0.1;
  const CloudOptions cloud = {.max_range_m = options.max_range_m,
                              .voxel_m = options.spacing_m,
                              .max_pose_gap_s = kLongestGap_s,
                              .max_points = 10'000'000};
  if (auto valid = Validate(cloud); !valid) return tl::unexpected(valid.error());
  CloudBuilder builder(trajectory, cloud);
  TrajectoryCrispness crispness;
  Result<void> added;
  const auto read = ReadRecording(log, reader, [&](LogRecord&& record) {
    if (const auto* scan = std::get_if<Scan>(&record)) {
      const auto placed = builder.scans_used();
      if (std::abs(scan->tilt_rad) < kLevel_rad && ValidateScan(*scan)) added = Place(*scan, builder);
      ++(builder.scans_used() > placed ? crispness.scans : crispness.scans_left_out);
    }
    return added.has_value() && !Interrupted();
  });
  if (!read) return tl::unexpected(read.error());
  if (!added) return tl::unexpected(added.error());
  if (Interrupted()) return Stopped();
  if (crispness.scans == 0)
    return Fail(StatusCode::kFailedPrecondition, log + ": no scan has a pose on the trajectory");
  auto map = MapEntropy(builder.cloud(), options.entropy);
  if (!map) return tl::unexpected(map.error());
  crispness.map = *map;
  crispness.points = builder.cloud().size();
  return crispness;
}

}  // namespace cairn::client
