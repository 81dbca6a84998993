// A robot's stamped poses in one frame, and the TUM text format for them (`stamp tx ty tz qx qy qz qw`, seconds).
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/stamp.h"
#include "common/status.h"

namespace cairn {

struct StampedPose {
  Stamp stamp = 0;
  Pose2 T_map_robot;
};

using Trajectory = std::vector<StampedPose>;  // Increasing stamps.

// The pose at a stamp, interpolated between neighbours at most `max_gap_s` apart.
[[nodiscard]] std::optional<Pose2> PoseOn(const Trajectory& path, Stamp stamp, double max_gap_s);

// One line per pose, stamps with nanoseconds, 9 decimals; written beside the target and renamed (atomic).
[[nodiscard]] Result<void> WriteTum(const Trajectory& trajectory, const std::filesystem::path& path);
[[nodiscard]] Result<Trajectory> ReadTum(const std::filesystem::path& path);

}  // namespace cairn
