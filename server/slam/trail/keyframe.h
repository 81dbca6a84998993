// A keyframe is a scan that is kept because the robot moved enough since the last one. Keyframes have indices from 0 in
// the order of time, which mean the same keyframe everywhere in slam until some are retired (retirement.h). A
// keyframe's number never changes: it is the count of those before it, retired ones too. Plain values.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "common/sensor/trajectory.h"
#include "server/slam/graph/pose_graph.h"
#include "server/slam/trail/kept_scan.h"

namespace cairn::slam {

struct Keyframe {
  KeptScan scan;
  Pose2 T_odom_robot;
  bool localized = true;  // Otherwise its pose is not known, and it is drawn into no map.
  // Not localized, because the path contradicts the scans; but where it lies along the path is known. It counts as
  // localized once the path has been corrected.
  bool tentative = false;

  template <typename Archive>
  static void InlineMembers(Archive& archive, auto& self) {
    if constexpr (Archive::kReads) {
      auto read = std::make_shared<Scan>();
      archive(*read);
      self.scan = std::move(read);
      self.scan.Pack();
    } else {
      archive(*self.scan);
    }
    archive(self.T_odom_robot, self.localized, self.tentative);
  }
};

// Where a keyframe lies along the way of the robot. Its surface points are at Trail::points.
struct KeyframeShape {
  // Pose in the front-end's frame: exact relative to neighbours, but it drifts over the whole path.
  Pose2 T_track_robot;
  double travelled_m = 0.0;  // Distance travelled along the path up to this keyframe.
  std::uint64_t number = 0;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.T_track_robot, self.travelled_m, self.number);
  }
};

// The pose of the robot relative to the old keyframe `keyframe`, measured by scan matching.
struct RevisitObservation {
  std::size_t keyframe = 0;
  Pose2 T_keyframe_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  // How many revisits there were on the last metres before. They were matched with the same surfaces, so their errors
  // are those of this one: in the stated doubt the n-th of them counts as 1/n.
  std::size_t alike = 0;
};

// The state of a mapper at one moment as jobs use it, shared without locks: the keyframes, the path of the
// best particle through them (full SLAM), the relations between them, and the pose of every scan relative to
// the last keyframe before it, or to the one that represents that keyframe. Of the scans during which the robot's place
// was not certain (recovery.h), only those are here that became keyframes later.
struct MapperSnapshot {
  std::vector<Keyframe> keyframes;
  std::vector<std::uint64_t> numbers;  // Of the keyframes. Empty: 0, 1, 2, ...
  std::vector<Pose2> online_path;      // T_map_robot per keyframe with which it was drawn into the grid.
  std::vector<Pose2> full_path;        // T_map_robot per keyframe along the best particle's ancestry.
  // Steps, revisits and loops, as they were measured; empty if the filter uses none of them, or if no place was seen
  // again.
  std::vector<PoseRelation> relations;
  // The measured steps, if `relations` is empty and an earlier job has bent the path; else they are those along the
  // path.
  std::vector<PoseRelation> steps{};
  PoseGraphOptions pose_graph;
  struct ScanPlace {
    Stamp stamp = 0;
    // Index of the last keyframe at or before the scan, or of the one that represents it.
    std::size_t keyframe = 0;
    Pose2 T_keyframe_robot;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.stamp, self.keyframe, self.T_keyframe_robot);
    }
  };
  std::vector<ScanPlace> scans;

  // How many keyframes there have been, with those that were retired.
  [[nodiscard]] std::uint64_t made() const { return numbers.empty() ? keyframes.size() : numbers.back() + 1; }
  // Converts a path with one pose per keyframe to a trajectory with one pose per scan.
  [[nodiscard]] Trajectory TrajectoryAlong(std::span<const Pose2> path) const;
  [[nodiscard]] Trajectory FullTrajectory() const { return TrajectoryAlong(full_path); }
};

}  // namespace cairn::slam
