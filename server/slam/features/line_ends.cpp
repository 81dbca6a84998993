#include "server/slam/features/line_ends.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

// Computes the point `p` at which the ray from the laser to `end_point`, turned by `turn`, meets the line.
// False if they do not meet.
bool Continuation(const Sweep& sweep, const FittedLine& line, const Eigen::Vector2d& end_point, double turn,
                  Eigen::Vector2d& p) {
  const Eigen::Vector2d ray = end_point - sweep.laser();
  const double c = std::cos(turn), s = std::sin(turn);
  const Eigen::Vector2d next(c * ray.x() - s * ray.y(), s * ray.x() + c * ray.y());
  const double facing = line.normal.dot(next);
  if (std::abs(facing) < 1e-9) return false;
  const double factor = -line.DistanceOf(sweep.laser()) / facing;
  if (factor <= 0.0) return false;
  p = sweep.laser() + factor * next;
  return true;
}

bool Ended(const Sweep& sweep, const LineSegment& segment, int direction, const LineOptions& options) {
  const int at = direction > 0 ? segment.end - 1 : segment.begin;
  const SweepGap& gap = direction > 0 ? sweep.GapAfter(at) : sweep.GapBefore(at);
  if (gap.to_edge && gap.beams == 0) return false;
  const BeamPoint& end_hit = sweep.hit(at);

  // The point that the next beam would have hit if the line had continued.
  Eigen::Vector2d next_on_line;
  if (!Continuation(sweep, segment.line, end_hit.p_robot, direction * sweep.step(), next_on_line)) return false;
  const double spacing = (next_on_line - end_hit.p_robot).norm();
  if (spacing > options.end_uncertainty_m) return false;
  if ((next_on_line - sweep.laser()).norm() >= sweep.range_max()) return false;

  if (gap.no_returns > 0) return true;
  if (gap.to_edge || gap.beams > sweep.BeamsIn(options.max_gap_rad, 2) + 1) return false;
  const BeamPoint& next = sweep.hit(at + direction);
  const double distance = segment.line.DistanceOf(next.p_robot);
  const bool laser_side = (distance > 0.0) == (segment.line.DistanceOf(sweep.laser()) > 0.0);
  if (!laser_side && std::abs(distance) > SplitDistance(next.range_m, options)) return true;  // (3-10)
  const double across = end_hit.range_m * sweep.step() * gap.beams / std::sin(options.corner_incidence_rad);
  return (next.p_robot - end_hit.p_robot).norm() <= options.end_gap_m + spacing * gap.beams + across;  // (3-11)
}

}  // namespace

EndClass EndClassOf(const Sweep& sweep, const LineSegment& segment, const LineOptions& options) {
  const bool right = Ended(sweep, segment, -1, options), left = Ended(sweep, segment, +1, options);
  if (right && left) return EndClass::kBothEnded;
  if (right) return EndClass::kRightEnded;
  return left ? EndClass::kLeftEnded : EndClass::kOpen;
}

}  // namespace cairn::slam
