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

void Visit(OptionVisitor& visitor, RollingOptions& options) {
  visitor.Real(
      "surface_gap_m", options.deskew.surface_gap_m, "m", 0.0, 10.0,
      "Two neighbouring points of a scan lie on one surface if their distance is at most this and surface_steps "
      "times the distance of two beams there. Between them the moved scan is interpolated.");
  visitor.Real("surface_steps", options.deskew.surface_steps, "1", 0.0, 1000.0, "See surface_gap_m.");
  visitor.Real(
      "worthwhile_m", options.worthwhile_m, "m", 0.0, 10.0,
      "Where the match shows another motion during the scan than was assumed, the motion is taken out of the "
      "scan anew if its last beam moves by this much, or by worthwhile_rad. The default is the noise of a cheap "
      "lidar and the distance of two of its beams.");
  visitor.Real("worthwhile_rad", options.worthwhile_rad, "rad", 0.0, 3.2, "See worthwhile_m.");
}

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
