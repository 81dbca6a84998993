// Pairs of scans of one log, and how well the two scans of a pair agree for what is supposed about the lidar: when its
// beams were measured, how late its stamps are, and where it is mounted. The scans are aligned freely, so that the
// agreement shows what is wrong within a scan (when its beams were measured), and the alignment, beside odometry, what
// is wrong between two scans (lag, wheels, mounting).
// Frames: scans and alignments in `laser`. Stateless, thread-safe.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/sensor/lidar_timing.h"
#include "common/sensor/scan.h"
#include "server/slam/calibration/odometry_path.h"
#include "server/slam/matching/match_result.h"
#include "server/slam/parallel_for.h"
#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

// One robot's log. The arrays of the scans are as they were logged, whatever is known of their timing. REQUIRES: scans
// passed ValidateScan, odometry ValidateOdometry, and all stamps are within 2^61 ns.
struct LaserLog {
  std::vector<std::shared_ptr<const Scan>> scans;  // In the order of their stamps.
  std::vector<Odometry> odometry;
};

// What is supposed about a robot.
struct LaserGuess {
  LidarTiming timing;  // With a scan period, stamp_at is kMiddle.
  double lag_s = 0.0;  // Stamps of scans are later by this than the clock of odometry.
  WheelCorrection wheels;
  Pose2 T_robot_laser;
};

// A scan as the lidar would have seen it at one moment.
struct ScanAtOnce {
  Stamp stamp = 0;  // On the clock of odometry: the first beam.
  std::vector<SurfacePoint> points_laser;
};

// Nothing if odometry does not cover the scan, or if nothing is left of it.
[[nodiscard]] std::optional<ScanAtOnce> AtOnce(const Scan& scan, const LaserGuess& guess, const OdometryPath& odometry);

// Indices of two scans of the log.
struct PairOfScans {
  std::size_t first = 0;
  std::size_t second = 0;
};

// Scans that follow each other after a short way or turn, from the whole log. At most `most`, spread evenly.
[[nodiscard]] std::vector<PairOfScans> PairsAlongTheWay(const LaserLog& log, const OdometryPath& odometry,
                                                        std::size_t most);
// Scans near each other between which the robot turned at different speeds. What the motion during a scan has done to
// two scans differs between them; between scans that follow each other in a steady turn it is the same. Those with the
// largest differences, at most `most`, in the order of the log; none where the robot did not turn.
[[nodiscard]] std::vector<PairOfScans> PairsOfUnequalTurns(const LaserLog& log, const OdometryPath& odometry,
                                                           std::size_t most);

struct AlignedPair {
  bool found = false;
  Stamp first = 0;  // Of ScanAtOnce, of both scans.
  Stamp second = 0;
  MatchResult match;          // T_ref_curr is T_first_second, of the laser.
  double disagreement = 0.0;  // Mean square distance of the second scan's points from the first one's surfaces, in m^2.
};

[[nodiscard]] std::vector<AlignedPair> AlignPairs(const LaserLog& log, const OdometryPath& odometry,
                                                  std::span<const PairOfScans> pairs, const LaserGuess& guess,
                                                  const ParallelFor& parallel_for);

}  // namespace cairn::slam
