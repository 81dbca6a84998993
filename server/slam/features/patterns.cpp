#include "server/slam/features/patterns.h"

#include <limits>

#include "common/geometry/angle.h"
#include "server/slam/features/corners.h"

namespace cairn::slam {

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
