#include "server/slam/scan/scan_motion.h"

#include <cmath>

#include "server/slam/scan/deskew.h"
#include "server/slam/scan/stamp_gate.h"

namespace cairn::slam {
namespace {

// A turn within a scan is followed in so many straight pieces.
constexpr int kPieces = 16;

Pose2 Share(const Pose2& step, double share) {
  return {share * step.x, share * step.y, WrapAngle(share * step.theta)};
}

}  // namespace

std::vector<Odometry> AtConstantVelocity(const Scan& scan, const Pose2& step, double seconds) {
  const std::uint64_t duration_ns = DurationNs(scan);
  const Pose2 piece = Share(step, 1e-9 * static_cast<double>(duration_ns) / (kPieces * seconds));
  std::vector<Odometry> samples(kPieces + 1);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].stamp = static_cast<Stamp>(static_cast<std::uint64_t>(scan.stamp) + duration_ns * i / kPieces);
    if (i > 0) samples[i].T_odom_robot = samples[i - 1].T_odom_robot * piece;
  }
  return samples;
}

std::vector<Odometry> CorrectedMotion(const RollingScan& rolling, const Pose2& step, const Pose2& odometry_step,
                                      double seconds) {
  const Pose2 missed = Between(odometry_step, step);
  std::vector<Odometry> samples = rolling.odometry;
  for (Odometry& sample : samples) {
    // The first sample may be before the scan.
    const auto since_ns = static_cast<std::int64_t>(NanosBetween(rolling.scan->stamp, sample.stamp));
    sample.T_odom_robot = sample.T_odom_robot * Share(missed, 1e-9 * static_cast<double>(since_ns) / seconds);
  }
  return samples;
}

Pose2 DifferenceAtTheEnd(const std::vector<Odometry>& a, const std::vector<Odometry>& b) {
  return Between(Between(a.front().T_odom_robot, a.back().T_odom_robot),
                 Between(b.front().T_odom_robot, b.back().T_odom_robot));
}

}  // namespace cairn::slam
