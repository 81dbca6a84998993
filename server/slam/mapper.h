// The estimator of one robot: scans and odometry in, pose, landmarks and an occupancy grid out. The recipe of
// server/slam, top to bottom. A machine of values: same options, seed, start and inputs give the same bytes out, on any
// thread count. Not thread-safe: one session owns one mapper. Inputs must be validated (ValidateScan) and paired
// (OdometryPairing) first.
// Source: thesis A, chapters 3 and 4 (feature-based scan matching feeding FastSLAM 2.0).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "common/sensor/scan.h"
#include "common/service/pose_report.h"
#include "server/slam/grid/occupancy_grid.h"
#include "server/slam/keyframe.h"
#include "server/slam/landmark.h"
#include "server/slam/mapper_options.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

// What one scan did.
struct ScanOutcome {
  Stamp stamp = 0;
  // Online estimate: the best hypothesis now. Relative to the start while nobody knows its place in the map (kLost,
  // filter.h: placed).
  Pose2 T_map_robot;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // (x, y, theta) in map.
  Pose2 T_map_odom;
  bool localized = false;
  double score = 0.0;
  PoseReason reason = PoseReason::kWaiting;
  bool keyframe = false;  // The scan updated filter and map.
};

class Mapper {
 public:
  Mapper(const MapperOptions& options, const Pose2& T_map_robot_start, std::uint64_t seed);
  ~Mapper();
  Mapper(Mapper&&) noexcept;
  Mapper& operator=(Mapper&&) noexcept;

  // `T_odom_robot` is the odometry at the scan's stamp.
  ScanOutcome Process(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot, const ParallelFor& parallel_for);

  [[nodiscard]] const OccupancyGrid& grid() const;
  // Chunks of the grid changed since the last call.
  [[nodiscard]] std::vector<ChunkKey> TakeDirtyChunks();
  [[nodiscard]] std::vector<Landmark> landmarks() const;  // Of the best particle.
  [[nodiscard]] std::size_t keyframe_count() const;
  // Empty while the robot's place in the map is not known (filter.h: placed).
  [[nodiscard]] MapperSnapshot Snapshot() const;
  // Nothing more comes: what is still being drawn again since a large loop closed is drawn to its end.
  void FinishMap();
  // Replaces the grid by one redrawn from the first `keyframes` keyframes (a finished job), then draws the later
  // keyframes onto it along the current best path. Every chunk of the new grid becomes dirty;
  // what only the old one had is the caller's to compare.
  void AdoptGrid(OccupancyGrid grid, std::size_t keyframes);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn::slam
