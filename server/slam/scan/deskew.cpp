#include "server/slam/scan/deskew.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "server/slam/scan/beam_points.h"
#include "server/slam/scan/stamp_gate.h"

namespace cairn::slam {
namespace {

// Poses of the robot at times that grow, interpolated between samples of odometry.
class PoseWalk {
 public:
  explicit PoseWalk(std::span<const Odometry> samples) : samples_(samples), origin_(samples.front().stamp) {}

  Pose2 At(std::uint64_t ns_after_origin) {
    while (next_ < samples_.size() && Since(next_) <= ns_after_origin) ++next_;
    const Odometry& before = samples_[next_ - 1];
    if (next_ == samples_.size()) return before.T_odom_robot;
    const auto gap = static_cast<double>(Since(next_) - Since(next_ - 1));
    return Interpolate(before.T_odom_robot, samples_[next_].T_odom_robot,
                       static_cast<double>(ns_after_origin - Since(next_ - 1)) / gap);
  }

 private:
  [[nodiscard]] std::uint64_t Since(std::size_t sample) const { return NanosBetween(origin_, samples_[sample].stamp); }

  std::span<const Odometry> samples_;
  Stamp origin_;
  std::size_t next_ = 1;
};

// The end of a beam as the lidar would see it at the stamp of the scan.
struct MovedEnd {
  BeamClass kind = BeamClass::kInvalid;
  Eigen::Vector2d p_laser = Eigen::Vector2d::Zero();  // At the stamp. Of a beam without a hit: its direction.
  double beam = 0.0;                                  // Where it lies between the beams of the scan.
  float range_m = 0.0F;
};

std::vector<MovedEnd> MovedEnds(const Scan& scan, std::span<const Odometry> odometry) {
  PoseWalk walk(odometry);
  const std::uint64_t start = NanosBetween(odometry.front().stamp, scan.stamp);
  const Pose2 T_first_odom = (walk.At(start) * scan.T_robot_laser).Inverse();
  std::vector<MovedEnd> ends(scan.ranges_m.size());
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const auto index = static_cast<double>(i);
    const Pose2 T_odom_robot =
        walk.At(start + static_cast<std::uint64_t>(std::llround(index * scan.beam_period_s * 1e9)));
    const Pose2 T_first_laser = T_first_odom * T_odom_robot * scan.T_robot_laser;
    const double angle = scan.angle_first_rad + index * scan.angle_step_rad;
    const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
    MovedEnd& end = ends[i];
    end.kind = ClassifyRange(scan.ranges_m[i], scan.range_min_m, scan.range_max_m);
    end.range_m = scan.ranges_m[i];
    end.p_laser = end.kind == BeamClass::kHit ? T_first_laser * (direction * scan.ranges_m[i])
                                              : Eigen::Vector2d(T_first_laser.rotation() * direction);
    const double seen_at = std::atan2(end.p_laser.y(), end.p_laser.x());
    end.beam = index + WrapAngle(seen_at - angle) / scan.angle_step_rad;
  }
  return ends;
}

// Where the direction cuts the line from a to b; nothing if they are nearly parallel.
std::optional<double> RangeOfCut(const Eigen::Vector2d& direction, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d d = b - a;
  const double across = direction.x() * d.y() - direction.y() * d.x();
  if (std::abs(across) < 1e-3 * d.norm()) return std::nullopt;
  return (a.x() * d.y() - a.y() * d.x()) / across;
}

// Collects the ranges of the result. The first one at a beam stays.
class Resampling {
 public:
  Resampling(const Scan& scan, const DeskewOptions& options)
      : scan_(scan),
        options_(options),
        turn_(IsFullTurn(scan) ? std::round(2.0 * kPi / std::abs(scan.angle_step_rad)) : 0.0),
        // A hit stays a hit, although it is a little farther from where the lidar was at the stamp.
        farthest_(std::nextafter(static_cast<float>(std::min<double>(scan.range_max_m, kLargest)), 0.0F)),
        ranges_(scan.ranges_m.size(), std::numeric_limits<float>::quiet_NaN()) {}

  // Every beam between two neighbouring ends on one surface.
  void AddSurface(const MovedEnd& from, const MovedEnd& to) {
    const double spacing = std::max(from.p_laser.norm(), to.p_laser.norm()) * std::abs(scan_.angle_step_rad);
    if ((to.p_laser - from.p_laser).norm() > options_.surface_gap_m + options_.surface_steps * spacing ||
        Opposite(from, to))
      return;
    ForEachBeam(std::ceil(std::min(from.beam, to.beam)), std::floor(std::max(from.beam, to.beam)), [&](double beam) {
      const double angle = scan_.angle_first_rad + beam * scan_.angle_step_rad;
      const auto range = RangeOfCut({std::cos(angle), std::sin(angle)}, from.p_laser, to.p_laser);
      if (range && *range > 0.0) Put(beam, *range);
    });
  }
  void AddHit(const MovedEnd& end) {
    const double beam = std::round(end.beam);
    ForEachBeam(beam, beam, [&](double at) { Put(at, end.p_laser.norm()); });
  }
  // Every beam from one that hit nothing to the next one.
  void AddNoReturns(const MovedEnd& before, const MovedEnd& to) {
    const MovedEnd& from = Opposite(before, to) ? to : before;
    ForEachBeam(std::round(std::min(from.beam, to.beam)), std::round(std::max(from.beam, to.beam)),
                [&](double beam) { *At(beam) = to.range_m; });
  }
  [[nodiscard]] std::vector<float> ranges() && { return std::move(ranges_); }

 private:
  static constexpr double kLargest = std::numeric_limits<float>::max();

  // Half a turn apart or more, as where the robot turns fast or an end passes behind the lidar: nothing lies between.
  [[nodiscard]] bool Opposite(const MovedEnd& from, const MovedEnd& to) const {
    return !(std::abs(to.beam - from.beam) * std::abs(scan_.angle_step_rad) < kPi);
  }
  // The beams within the field of view that have no range yet. Beams outside are skipped.
  template <typename Visit>
  void ForEachBeam(double first, double last, Visit visit) {
    if (turn_ == 0.0) {
      first = std::max(first, 0.0);
      last = std::min(last, static_cast<double>(ranges_.size()) - 1.0);
    }
    for (double beam = first; beam <= last; ++beam) {
      const float* const range = At(beam);
      if (range != nullptr && std::isnan(*range)) visit(beam);
    }
  }
  // Null outside the field of view.
  float* At(double beam) {
    if (turn_ > 0.0) beam -= turn_ * std::floor(beam / turn_);
    return beam >= 0.0 && beam < static_cast<double>(ranges_.size()) ? &ranges_[static_cast<std::size_t>(beam)]
                                                                     : nullptr;
  }
  void Put(double beam, double range_m) {
    if (range_m >= scan_.range_min_m) *At(beam) = std::min(static_cast<float>(std::min(range_m, kLargest)), farthest_);
  }

  const Scan& scan_;
  const DeskewOptions options_;
  const double turn_;  // Beams of a full turn; 0 if the field of view is smaller.
  const float farthest_;
  std::vector<float> ranges_;
};

}  // namespace

std::uint64_t DurationNs(const Scan& scan) {
  if (scan.beam_period_s == 0.0) return 0;
  return static_cast<std::uint64_t>(
      std::llround(static_cast<double>(scan.ranges_m.size() - 1) * scan.beam_period_s * 1e9));
}

Scan Deskew(const Scan& scan, std::span<const Odometry> odometry, const DeskewOptions& options) {
  Scan still = scan;
  still.beam_period_s = 0.0;
  const bool moved = std::any_of(odometry.begin(), odometry.end(), [&](const Odometry& sample) {
    return sample.T_odom_robot != odometry.front().T_odom_robot;
  });
  if (!moved) return still;
  const std::vector<MovedEnd> ends = MovedEnds(scan, odometry);
  Resampling resampling(scan, options);
  for (std::size_t i = 1; i < ends.size(); ++i) {
    if (ends[i - 1].kind == BeamClass::kHit && ends[i].kind == BeamClass::kHit)
      resampling.AddSurface(ends[i - 1], ends[i]);
  }
  for (const MovedEnd& end : ends) {
    if (end.kind == BeamClass::kHit) resampling.AddHit(end);
  }
  for (std::size_t i = 0; i < ends.size(); ++i) {
    if (ends[i].kind != BeamClass::kNoReturn) continue;
    const bool joined = i > 0 && ends[i - 1].kind == BeamClass::kNoReturn;
    resampling.AddNoReturns(joined ? ends[i - 1] : ends[i], ends[i]);
  }
  still.ranges_m = std::move(resampling).ranges();
  return still;
}

}  // namespace cairn::slam
