#include "server/slam/calibration/odometry_path.h"

#include <algorithm>

namespace cairn::slam {

OdometryPath::OdometryPath(std::span<const Odometry> samples, const WheelCorrection& wheels) {
  samples_.reserve(samples.size());
  Pose2 raw_before;
  for (const Odometry& sample : samples) {
    Odometry corrected = sample;
    if (!samples_.empty()) {
      if (sample.stamp <= samples_.back().stamp) continue;
      corrected.T_odom_robot = samples_.back().T_odom_robot * wheels.Apply(Between(raw_before, sample.T_odom_robot));
    }
    raw_before = sample.T_odom_robot;
    samples_.push_back(corrected);
  }
}

std::size_t OdometryPath::FirstNotBefore(Stamp stamp) const {
  const auto at = std::lower_bound(samples_.begin(), samples_.end(), stamp,
                                   [](const Odometry& sample, Stamp wanted) { return sample.stamp < wanted; });
  return static_cast<std::size_t>(at - samples_.begin());
}

std::optional<Pose2> OdometryPath::At(Stamp stamp) const {
  const std::size_t after = FirstNotBefore(stamp);
  if (after == samples_.size()) return std::nullopt;
  const Odometry& b = samples_[after];
  if (b.stamp == stamp) return b.T_odom_robot;
  if (after == 0) return std::nullopt;
  const Odometry& a = samples_[after - 1];
  const double gap_s = SecondsFromStamp(b.stamp - a.stamp);
  if (gap_s > kLongestGap_s) return std::nullopt;
  return Interpolate(a.T_odom_robot, b.T_odom_robot, SecondsFromStamp(stamp - a.stamp) / gap_s);
}

std::span<const Odometry> OdometryPath::Covering(Stamp from, Stamp to) const {
  std::size_t first = FirstNotBefore(from);
  const std::size_t last = FirstNotBefore(to);
  if (last == samples_.size()) return {};
  if (samples_[first].stamp != from) {
    if (first == 0) return {};
    --first;
  }
  for (std::size_t i = first; i < last; ++i)
    if (SecondsFromStamp(samples_[i + 1].stamp - samples_[i].stamp) > kLongestGap_s) return {};
  return {samples_.data() + first, last - first + 1};
}

double OdometryPath::TurnRate(Stamp stamp, double window_s) const {
  const Stamp half = StampFromSeconds(0.5 * window_s);
  const auto before = At(stamp - half), after = At(stamp + half);
  if (!before || !after) return 0.0;
  return AngleDiff(after->theta, before->theta) / window_s;
}

}  // namespace cairn::slam
