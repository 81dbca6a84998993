// One scan prepared for line extraction: its hits in anticlockwise order, whichever way the scanner turns,
// and the gaps between them. In a full-turn scan indices continue beyond the last hit: hit i and hit i +
// size() are the same. Not an extractor: it contains no lines. Read-only after construction.
#pragma once

#include <span>
#include <vector>

#include "common/sensor/scan.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {

// The gap between one hit and the next.
struct SweepGap {
  int beams = 1;         // Beams from hit to hit; at an edge, the beams beyond the last hit.
  int no_returns = 0;    // Beams in between without an echo.
  bool to_edge = false;  // There is no next hit, because the scan ends here.
};

class Sweep {
 public:
  // `points` must be PointsOf(scan), possibly thinned, in the order of the beams.
  Sweep(std::span<const BeamPoint> points, const Scan& scan);

  [[nodiscard]] int size() const { return static_cast<int>(hits_.size()); }
  [[nodiscard]] bool full_turn() const { return full_turn_; }
  [[nodiscard]] double step() const { return step_; }
  [[nodiscard]] double range_max() const { return range_max_; }
  // Position of the laser in the robot frame.
  [[nodiscard]] const Eigen::Vector2d& laser() const { return laser_; }

  // Valid indices are [0, size()), and in a full-turn scan all from -size() up.
  [[nodiscard]] int Wrap(int i) const { return full_turn_ ? (i + size()) % size() : i; }
  [[nodiscard]] const BeamPoint& hit(int i) const { return hits_[static_cast<std::size_t>(Wrap(i))]; }
  [[nodiscard]] const SweepGap& GapAfter(int i) const { return gaps_[static_cast<std::size_t>(Wrap(i)) + 1]; }
  [[nodiscard]] const SweepGap& GapBefore(int i) const { return gaps_[static_cast<std::size_t>(Wrap(i))]; }

  // Number of beams in `angle_rad`, but at least `minimum`.
  [[nodiscard]] int BeamsIn(double angle_rad, int minimum) const;

 private:
  void MeasureGaps(const Scan& scan);

  std::vector<BeamPoint> hits_;
  std::vector<SweepGap> gaps_;  // gaps_[i] lies before hit i; there are size() + 1 gaps.
  double step_ = 0.0;
  double range_max_ = 0.0;
  Eigen::Vector2d laser_ = Eigen::Vector2d::Zero();
  bool full_turn_ = false;
};

}  // namespace cairn::slam
