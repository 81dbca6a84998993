// Converts a log to steps for DP-SLAM (odometry motion, scan), and runs the filter over them with all figures: time,
// memory, size of the ancestry tree, path and map. For studies only. Uses two threads if asked to.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/slam/dpslam/dpslam.h"
#include "tests/studies/logs.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {

struct GridStep {
  Stamp stamp = 0;
  Pose2 T_prev_curr;  // By odometry.
  std::shared_ptr<const Scan> scan;
};

// Scans that are at least this far apart by odometry; all scans if both are 0.
[[nodiscard]] std::vector<GridStep> GridSteps(const StudyLog& log, double gate_m, double gate_rad);

struct GridRun {
  std::string name;
  std::vector<double> cpu_ms;   // Of every scan, all threads ...
  std::vector<double> wall_ms;  // ... and on the wall.
  std::vector<double> map_mib;  // All particles' maps after every scan.
  std::size_t most_nodes = 0;   // Of the low level's family tree, and its longest line.
  std::size_t longest_line = 0;
  bool bounds_hold = true;      // Fewer than two nodes a living particle, no line longer than their number.
  int diverged = 0;             // Scans after which the filter reported that it has diverged.
  double log_likelihood = 0.0;  // The log likelihood of the best particle.
  Trajectory path;              // The path of the best particle at the end.
  OccupancyImage map;           // The opacity map of the best particle.
  double naive_mib = 0.0;       // Memory if each particle had its own copy of the map (4 bytes per cell).

  [[nodiscard]] double PeakMib() const;
};

[[nodiscard]] GridRun RunGrid(const std::string& name, const std::vector<GridStep>& steps,
                              const Pose2& T_map_robot_start, const slam::DpSlamOptions& options, std::uint64_t seed,
                              int threads);

// The error of the path between two visits of one place, against the truth: means over all pairs of poses at
// the same place (within 1 m) that are more than `apart_m` of path apart.
struct LoopError {
  int pairs = 0;
  double trans_m = 0.0;
  double rot_deg = 0.0;
};
[[nodiscard]] LoopError LoopErrorOf(const Trajectory& path, const Trajectory& truth, double apart_m);

}  // namespace cairn::studies
