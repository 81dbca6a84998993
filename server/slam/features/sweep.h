// One scan laid out as line extraction walks it: hits in anticlockwise order whichever way the scanner turns, and what
// lies between them. In a full-turn scan indices go on past the last hit: hit i and hit i + size() are the same. Not an
// extractor: knows no lines. Read-only after construction.
#pragma once

#include <span>
#include <vector>

#include "common/sensor/scan.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {

// What lies between one hit and the next.
struct SweepGap {
  int beams = 1;         // From hit to hit; 1 for neighbours. To the edge: beams beyond the last hit.
  int no_returns = 0;    // Beams in between that hit nothing.
  bool to_edge = false;  // There is no next hit: the scan ends.
};

class Sweep {
 public:
  // `points` are those of `scan` (PointsOf), possibly thinned, in the order of its beams.
  Sweep(std::span<const BeamPoint> points, const Scan& scan);

  [[nodiscard]] int size() const { return static_cast<int>(hits_.size()); }
  [[nodiscard]] bool full_turn() const { return full_turn_; }
  [[nodiscard]] double step() const { return step_; }
  [[nodiscard]] double range_max() const { return range_max_; }
  [[nodiscard]] const Eigen::Vector2d& laser() const { return laser_; }  // In the robot frame.

  // Valid indices: [0, size()), in a full-turn scan any from -size() up.
  [[nodiscard]] int Wrap(int i) const { return full_turn_ ? (i + size()) % size() : i; }
  [[nodiscard]] const BeamPoint& hit(int i) const { return hits_[static_cast<std::size_t>(Wrap(i))]; }
  [[nodiscard]] const SweepGap& GapAfter(int i) const { return gaps_[static_cast<std::size_t>(Wrap(i)) + 1]; }
  [[nodiscard]] const SweepGap& GapBefore(int i) const { return gaps_[static_cast<std::size_t>(Wrap(i))]; }

  // Beams that make up `angle`, at least `minimum`.
  [[nodiscard]] int BeamsIn(double angle_rad, int minimum) const;

 private:
  void MeasureGaps(const Scan& scan);

  std::vector<BeamPoint> hits_;
  std::vector<SweepGap> gaps_;  // gaps_[i] is before hit i; size() + 1 of them.
  double step_ = 0.0;
  double range_max_ = 0.0;
  Eigen::Vector2d laser_ = Eigen::Vector2d::Zero();
  bool full_turn_ = false;
};

}  // namespace cairn::slam
