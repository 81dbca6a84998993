#include "server/slam/features/corners.h"

#include <cmath>
#include <limits>

#include "common/geometry/angle.h"

namespace cairn::slam {
namespace {

double SpacingAtEnd(const LineFeature& line, const Eigen::Vector2d& end, double step) {
  const double range = end.norm();
  return range * step / std::max(line.distance / std::max(range, 1e-9), 0.05);
}

bool EndsMeet(const LineFeature& a, const LineFeature& b, const Eigen::Vector2d& corner, double step,
              const CornerOptions& options) {
  const double reach_a = options.real_gap_m + SpacingAtEnd(a, a.last, step);
  const double reach_b = options.real_gap_m + SpacingAtEnd(b, b.first, step);
  return (corner - a.last).norm() <= reach_a && (corner - b.first).norm() <= reach_b;
}

}  // namespace

std::optional<Eigen::Vector2d> MeetingPoint(const LineFeature& a, const LineFeature& b, double min_angle_rad) {
  const Eigen::Vector2d u = a.direction(), v = b.direction();
  const double sine = u.x() * v.y() - u.y() * v.x();
  if (std::abs(sine) < std::sin(min_angle_rad)) return std::nullopt;
  const Eigen::Vector2d between = b.first - a.first;
  const double along = (between.x() * v.y() - between.y() * v.x()) / sine;
  return a.first + along * u;
}

std::vector<CornerFeature> ExtractCorners(const ScanFeatures& features, const CornerOptions& options) {
  std::vector<CornerFeature> corners;
  const std::vector<LineFeature>& lines = features.lines;
  const int count = static_cast<int>(lines.size());
  corners.reserve(lines.size() * 2);
  const auto add = [&](int a, int b, bool following) {
    const LineFeature &line_a = lines[static_cast<std::size_t>(a)], &line_b = lines[static_cast<std::size_t>(b)];
    const bool both_long = line_a.length >= options.long_line_m && line_b.length >= options.long_line_m;
    if (!following && !both_long) return;
    const auto corner = MeetingPoint(line_a, line_b, options.min_angle_rad);
    if (!corner) return;
    const bool real = following && EndsMeet(line_a, line_b, *corner, features.angle_step_rad, options);
    if (!real && corner->norm() > options.max_distance_m) return;
    corners.push_back({.position = *corner,
                       .real = real,
                       .angle = AngleDiff(line_b.slope, line_a.slope),
                       .long_lines = both_long,
                       .line_a = a,
                       .line_b = b});
  };
  for (int a = 0; a < count; ++a) {
    for (int b = a + 1; b < count; ++b) {
      const bool across_seam = features.full_turn && count > 2 && a == 0 && b + 1 == count;
      if (!across_seam) add(a, b, b == a + 1);
    }
  }
  if (features.full_turn && count > 2) add(count - 1, 0, true);
  return corners;
}

void Visit(OptionVisitor& visitor, CornerOptions& options) {
  visitor.Real("min_angle_rad", options.min_angle_rad, "rad", 0.01, 1.5,
               "Smallest angle between the two lines of a corner.");
  visitor.Real("real_gap_m", options.real_gap_m, "m", 0.0, 5.0,
               "Two lines form a real corner if their ends are this near to it, in addition to the spacing of two "
               "beams. A larger value gives more and less accurate corners.");
  visitor.Real("long_line_m", options.long_line_m, "m", 0.0, 100.0,
               "Lines of at least this length are long. All pairs of long lines have virtual corners.");
  visitor.Real("max_distance_m", options.max_distance_m, "m", 0.1, 1000.0,
               "Virtual corners farther away from the robot are dropped.");
}

std::vector<LinePattern> PatternsOf(const std::vector<LineFeature>& lines, bool full_turn, double min_angle_rad) {
  constexpr double kBlank = std::numeric_limits<double>::quiet_NaN();
  const int count = static_cast<int>(lines.size());
  const auto line_at = [&](int i) -> const LineFeature& { return lines[static_cast<std::size_t>(i % count)]; };
  std::vector<LinePattern> patterns(lines.size());
  std::vector<Eigen::Vector2d> corners(lines.size(), {kBlank, kBlank});

  for (int i = 0; i < count; ++i) {
    LinePattern& pattern = patterns[static_cast<std::size_t>(i)];
    const int followers = full_turn ? count - 1 : count - 1 - i;
    pattern.count = std::min(followers, kPatternSize);
    pattern.angle.fill(kBlank);
    for (int j = 1; j <= pattern.count; ++j) {
      pattern.angle[static_cast<std::size_t>(j) - 1] = AngleDiff(line_at(i).slope, line_at(i + j).slope);
    }
    for (int j = 1; j <= followers && pattern.corner_with < 0; ++j) {
      const auto corner = MeetingPoint(line_at(i), line_at(i + j), min_angle_rad);
      if (!corner) continue;
      corners[static_cast<std::size_t>(i)] = *corner;
      pattern.corner_with = (i + j) % count;
    }
  }
  for (int i = 0; i < count; ++i) {
    LinePattern& pattern = patterns[static_cast<std::size_t>(i)];
    pattern.corner_distance.fill(kBlank);
    for (int j = 1; j <= pattern.count; ++j) {
      // The distance is NaN if either corner is blank.
      pattern.corner_distance[static_cast<std::size_t>(j) - 1] =
          (corners[static_cast<std::size_t>((i + j) % count)] - corners[static_cast<std::size_t>(i)]).norm();
    }
  }
  return patterns;
}

}  // namespace cairn::slam
