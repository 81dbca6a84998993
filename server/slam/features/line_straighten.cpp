#include "server/slam/features/line_straighten.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

constexpr double kParallelRad = Radians(4.0);

double LengthOf(const Sweep& sweep, const LineSegment& segment) {
  return (sweep.hit(segment.end - 1).p_robot - sweep.hit(segment.begin).p_robot).norm();
}

}  // namespace

void StraightenBetweenParallels(const Sweep& sweep, const LineOptions& options, std::vector<LineSegment>& segments) {
  const int count = static_cast<int>(segments.size());
  for (int k = 0; k < count; ++k) {
    if (!sweep.full_turn() && (k == 0 || k + 1 == count)) continue;
    const LineSegment& before = segments[static_cast<std::size_t>((k + count - 1) % count)];
    const LineSegment& after = segments[static_cast<std::size_t>((k + 1) % count)];
    LineSegment& line = segments[static_cast<std::size_t>(k)];
    if (line.count() > options.correct_below_points || count < 3) continue;
    if (before.count() <= line.count() || after.count() <= line.count()) continue;
    const double across =
        before.line.normal.x() * after.line.normal.y() - before.line.normal.y() * after.line.normal.x();
    if (std::abs(across) > std::sin(kParallelRad)) continue;

    Eigen::Vector2d along = before.line.normal * before.sums.n;
    along += after.line.normal * (before.line.normal.dot(after.line.normal) < 0 ? -after.sums.n : after.sums.n);
    along.normalize();  // The mean normal of the parallel lines is the new direction of the line.
    const Eigen::Vector2d normal(-along.y(), along.x());
    const double sin_off = std::abs(line.line.normal.dot(along));
    const double sigma = std::max(line.line.deviation, options.range_sigma_m);
    const double slope_sigma = sigma * std::sqrt(12.0 / line.sums.n) / std::max(LengthOf(sweep, line), 1e-3);
    if (sin_off > std::sin(std::min(3.0 * slope_sigma, Radians(25.0)))) continue;
    line.line.normal = normal;  // The line turns about its own centroid.
    line.line.offset = normal.dot(line.line.centroid);
  }
}

}  // namespace cairn::slam
