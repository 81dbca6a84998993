// When a turning lidar measures its beams: the time of a turn, to which side it turns, and where in the logged array
// it begins. Two scans of one place, taken while the robot turned at different speeds, agree best if the true motion is
// taken out of both. Candidates are compared pair by pair; the doubt comes from drawing the pairs anew (Efron 1979).
// Stateless, deterministic. Not a lag: a constant delay of all beams does not show here (laser_mounting.h).
#pragma once

#include <cstdint>
#include <span>

#include "server/slam/calibration/laser_pairs.h"

namespace cairn::slam {

struct TurnFit {
  LidarTiming timing;  // Of the best candidate; stamp_at is kMiddle. A period of 0: all beams at once.
  int pairs = 0;       // Compared.
  // By how many standard deviations the best candidate agrees better than: the same lidar turning the other way (the
  // best of that side), and all beams at once. Below kShown the log does not show it.
  double sense_sigmas = 0.0;
  double turning_sigmas = 0.0;
  double period_doubt_s = 0.0;
  double from_doubt_rad = 0.0;  // 0 where the array is not a full turn: it begins at its end.
  double rms_m = 0.0;           // How far scans disagree then, and with all beams at once.
  double rms_at_once_m = 0.0;

  // A turn that explains less than a tenth of the disagreement may stand for something else, such as a lag that the log
  // does not show.
  static constexpr double kShown = 4.0, kLargestRmsShare = 0.95;
  [[nodiscard]] bool shown() const {
    return turning_sigmas >= kShown && sense_sigmas >= kShown && rms_m <= kLargestRmsShare * rms_at_once_m;
  }
};

// `guess`: what is supposed besides the timing. `period_s`: the time between two scans; no turn takes longer.
[[nodiscard]] TurnFit FitTurn(const LaserLog& log, const OdometryPath& odometry, std::span<const PairOfScans> pairs,
                              const LaserGuess& guess, double period_s, std::uint64_t seed,
                              const ParallelFor& parallel_for);

}  // namespace cairn::slam
