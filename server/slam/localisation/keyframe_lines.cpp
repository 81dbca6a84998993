#include "server/slam/localisation/keyframe_lines.h"

#include <algorithm>

#include "server/slam/features/feature_extraction.h"
#include "server/slam/matchers/polyline.h"

namespace cairn::slam {
namespace {

constexpr int kMinKeyframes = 2;  // A line seen only once may have been a moving object.

struct SeenLine {
  LineFeature line;
  int keyframes = 0;
  std::size_t last_keyframe = 0;
};

// A joined line may reach a further piece, so it is added to the map like a new line.
void AddTo(std::vector<SeenLine>& map, SeenLine seen, const PolylineOptions& options) {
  for (std::size_t k = 0; k < map.size();) {
    const auto joined = JoinCollinear(map[k].line, seen.line, options);
    if (!joined) {
      ++k;
      continue;
    }
    const bool same_keyframe = map[k].last_keyframe == seen.last_keyframe;
    seen = {*joined, map[k].keyframes + seen.keyframes - (same_keyframe ? 1 : 0),
            std::max(map[k].last_keyframe, seen.last_keyframe)};
    map[k] = map.back();
    map.pop_back();
    k = 0;
  }
  map.push_back(seen);
}

}  // namespace

LineFeature LineIn(const Pose2& T_a_b, const LineFeature& line_b) {
  LineFeature line = line_b;
  line.first = T_a_b * line_b.first;
  line.last = T_a_b * line_b.last;
  line.slope = WrapAngle(line_b.slope + T_a_b.theta);
  const Eigen::Vector2d normal = line.left_normal();
  const double offset = normal.dot(line.first), side = offset < 0.0 ? -1.0 : 1.0;
  line.distance = side * offset;
  line.normal_angle = WrapAngle(std::atan2(side * normal.y(), side * normal.x()));
  return line;
}

std::vector<MapLine> LinesOfKeyframes(std::span<const Keyframe> keyframes, std::span<const Pose2> path) {
  // The lines of one wall from two keyframes differ by the error of the path.
  PolylineOptions options;
  options.collinear_m = 0.1;
  std::vector<SeenLine> map;
  for (std::size_t k = 0; k < keyframes.size() && k < path.size(); ++k)
    for (const LineFeature& line : ExtractFeatures(*keyframes[k].scan, FeatureOptions{}).lines)
      AddTo(map, {LineIn(path[k], line), 1, k}, options);
  std::erase_if(map, [](const SeenLine& seen) { return seen.keyframes < kMinKeyframes; });
  std::ranges::stable_sort(map, [](const auto& a, const auto& b) { return a.line.length > b.line.length; });
  std::vector<MapLine> lines;
  lines.reserve(map.size());
  for (const SeenLine& seen : map) lines.push_back({seen.line.first, seen.line.last});
  return lines;
}

}  // namespace cairn::slam
