#include "server/slam/features/sweep.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {

Sweep::Sweep(std::span<const BeamPoint> points, const Scan& scan)
    : hits_(points.begin(), points.end()),
      step_(std::abs(scan.angle_step_rad)),
      range_max_(scan.range_max_m),
      laser_(scan.T_robot_laser.translation()) {
  full_turn_ = IsFullTurn(scan) && hits_.size() > 2;
  if (scan.angle_step_rad < 0.0) std::reverse(hits_.begin(), hits_.end());
  MeasureGaps(scan);
}

void Sweep::MeasureGaps(const Scan& scan) {
  const int beams = static_cast<int>(scan.ranges_m.size());
  const auto beam_at = [&](int position) { return scan.angle_step_rad < 0.0 ? beams - 1 - position : position; };
  gaps_.assign(hits_.size() + 1, {});
  std::size_t next = 0;
  SweepGap gap{.beams = 0};
  for (int position = 0; position < beams; ++position) {
    const int beam = beam_at(position);
    ++gap.beams;
    if (next < hits_.size() && hits_[next].beam == beam) {
      gaps_[next++] = gap;
      gap = {.beams = 0};
    } else if (ClassifyRange(scan.ranges_m[static_cast<std::size_t>(beam)], scan.range_min_m, scan.range_max_m) ==
               BeamClass::kNoReturn) {
      ++gap.no_returns;
    }
  }
  if (full_turn_) {
    gap.beams += gaps_.front().beams;
    gap.no_returns += gaps_.front().no_returns;
    gaps_.front() = gaps_.back() = gap;
  } else {
    gaps_.front().beams -= 1;
    gaps_.front().to_edge = gap.to_edge = true;
    gaps_.back() = gap;
    if (hits_.empty()) gaps_.front() = gap;
  }
}

int Sweep::BeamsIn(double angle_rad, int minimum) const {
  return std::max(minimum, static_cast<int>(std::lround(std::min(angle_rad / step_, 1e6))));
}

}  // namespace cairn::slam
