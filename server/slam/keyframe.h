// A scan kept because the robot moved enough since the last one, with the pose it was drawn at. Immutable once made.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "common/sensor/trajectory.h"
#include "server/slam/smoothing/pose_graph.h"

namespace cairn::slam {

struct Keyframe {
  std::shared_ptr<const Scan> scan;
  Pose2 T_odom_robot;
};

// What a job needs of a mapper at one moment, shared without locks: keyframes, the path of the best particle through
// them (full SLAM), what is known between them, and every scan's place relative to the keyframe before it.
struct MapperSnapshot {
  std::vector<Keyframe> keyframes;
  std::vector<Pose2> online_path;  // T_map_robot per keyframe as it was drawn into the grid.
  std::vector<Pose2> full_path;    // T_map_robot per keyframe along the best particle's ancestry.
  // Steps, revisits and loops; empty where the filter uses none of these or no place was seen again.
  std::vector<PoseRelation> relations;
  PoseGraphOptions pose_graph;
  struct ScanPlace {
    Stamp stamp = 0;
    std::size_t keyframe = 0;  // Index of the last keyframe at or before the scan.
    Pose2 T_keyframe_robot;
  };
  std::vector<ScanPlace> scans;

  // A path (one pose per keyframe) at every scan.
  [[nodiscard]] Trajectory TrajectoryAlong(std::span<const Pose2> path) const;
  [[nodiscard]] Trajectory FullTrajectory() const { return TrajectoryAlong(full_path); }
};

}  // namespace cairn::slam
