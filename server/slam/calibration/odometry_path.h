// The odometry of a whole log as a path, corrected for its wheels, that can be asked for any moment. Not thread-safe to
// build; then read from any thread.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "common/sensor/odometry.h"
#include "server/slam/scan/wheel_correction.h"

namespace cairn::slam {

class OdometryPath {
 public:
  // Samples whose stamp is not after the one before are left out.
  OdometryPath(std::span<const Odometry> samples, const WheelCorrection& wheels);

  // Nothing before the first sample, after the last one, and between two that are more than kLongestGap_s apart.
  [[nodiscard]] std::optional<Pose2> At(Stamp stamp) const;
  // The samples from the last one at or before `from` to the first one at or after `to`; empty if they do not cover
  // that time.
  [[nodiscard]] std::span<const Odometry> Covering(Stamp from, Stamp to) const;
  // Turn to the left per second around a moment, over `window_s`; 0 where the path is not known.
  [[nodiscard]] double TurnRate(Stamp stamp, double window_s) const;

  static constexpr double kLongestGap_s = 1.0;

 private:
  [[nodiscard]] std::size_t FirstNotBefore(Stamp stamp) const;

  std::vector<Odometry> samples_;
};

}  // namespace cairn::slam
