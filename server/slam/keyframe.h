// A scan kept because the robot moved enough since the last one, with the pose it was drawn at. Immutable once made.
#pragma once

#include <memory>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "common/sensor/trajectory.h"

namespace cairn::slam {

struct Keyframe {
  std::shared_ptr<const Scan> scan;
  Pose2 T_odom_robot;
};

// What a job needs of a mapper at one moment, shared without locks: keyframes, the path of the best particle through
// them (full SLAM), and every scan's place relative to the keyframe before it.
struct MapperSnapshot {
  std::vector<Keyframe> keyframes;
  std::vector<Pose2> online_path;  // T_map_robot per keyframe as it was estimated at the time.
  std::vector<Pose2> full_path;    // T_map_robot per keyframe along the best particle's ancestry.
  struct ScanPlace {
    Stamp stamp = 0;
    std::size_t keyframe = 0;  // Index of the last keyframe at or before the scan.
    Pose2 T_keyframe_robot;
  };
  std::vector<ScanPlace> scans;

  // The full path at every scan.
  [[nodiscard]] Trajectory FullTrajectory() const;
};

}  // namespace cairn::slam
