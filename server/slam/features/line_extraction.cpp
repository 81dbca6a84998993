#include "server/slam/features/line_extraction.h"

#include <cmath>

#include "server/slam/features/line_ends.h"
#include "server/slam/features/line_merge.h"
#include "server/slam/features/line_split.h"
#include "server/slam/features/sweep.h"

namespace cairn::slam {
namespace {

LineFeature FeatureOf(const Sweep& sweep, const LineSegment& segment, const LineOptions& options) {
  LineFeature feature;
  const FittedLine& line = segment.line;
  const BeamPoint &first = sweep.hit(segment.begin), &last = sweep.hit(segment.end - 1);
  feature.first = first.p_robot - line.DistanceOf(first.p_robot) * line.normal;
  feature.last = last.p_robot - line.DistanceOf(last.p_robot) * line.normal;
  const double side = line.offset < 0.0 ? -1.0 : 1.0;
  feature.normal_angle = std::atan2(side * line.normal.y(), side * line.normal.x());
  feature.distance = side * line.offset;
  const Eigen::Vector2d along = feature.last - feature.first;
  feature.slope = std::atan2(along.y(), along.x());
  feature.length = along.norm();
  feature.deviation = line.deviation;
  feature.first_beam = first.beam;
  feature.last_beam = last.beam;
  feature.point_count = segment.count();
  feature.ends = EndClassOf(sweep, segment, options);
  return feature;
}

}  // namespace

std::vector<LineFeature> ExtractLines(std::span<const BeamPoint> points, const Scan& scan, const LineOptions& options) {
  const Sweep sweep(points, scan);
  const std::vector<LineSegment> segments = MergeSegments(sweep, options, SplitIntoSegments(sweep, options));
  std::vector<LineFeature> lines;
  lines.reserve(segments.size());
  for (const LineSegment& segment : segments) lines.push_back(FeatureOf(sweep, segment, options));
  return lines;
}

void Visit(OptionVisitor& visitor, LineOptions& options) {
  visitor.Real("jump_m", options.jump_m, "m", 0.0, 5.0, "range jump between neighbouring beams that parts clusters");
  visitor.Real("grazing_rad", options.grazing_rad, "rad", 0.01, 1.5, "flattest view under which a wall stays whole");
  visitor.Real("max_gap_rad", options.max_gap_rad, "rad", 0.0, 1.0, "invalid beams tolerated inside a cluster");
  visitor.Real("split_m", options.split_m, "m", 0.001, 1.0, "distance of a point that splits its line");
  visitor.Real("split_per_m", options.split_per_m, "m/m", 0.0, 0.1, "added to split_m per metre of range");
  visitor.Real("merge_angle_rad", options.merge_angle_rad, "rad", 0.0, 1.0, "neighbours turned more are never joined");
  visitor.Real("occlusion_rad", options.occlusion_rad, "rad", 0.0, 3.0, "nearer points a line may go on behind");
  visitor.Real("occlusion_m", options.occlusion_m, "m", 0.0, 20.0, "hidden length a line may go on over");
  visitor.Real("min_length_m", options.min_length_m, "m", 0.01, 10.0, "shortest line kept");
  visitor.Integer("min_points", options.min_points, "points", 3, 1000, "fewest points of a line, far or edge-on");
  visitor.Integer("max_points_needed", options.max_points_needed, "points", 3, 1000, "points asked of a near line");
  visitor.Real("max_deviation_m", options.max_deviation_m, "m", 0.001, 1.0, "largest RMS of points about their line");
  visitor.Real("min_aspect", options.min_aspect, "", 0.0, 1000.0, "least length over deviation");
  visitor.Integer("correct_below_points", options.correct_below_points, "points", 0, 1000,
                  "lines of at most so many points between parallels are straightened; 0: never");
  visitor.Real("range_sigma_m", options.range_sigma_m, "m", 0.0001, 1.0, "noise of one range");
  visitor.Real("end_gap_m", options.end_gap_m, "m", 0.0, 5.0, "what follows so close closes an end");
  visitor.Real("corner_incidence_rad", options.corner_incidence_rad, "rad", 0.01, 1.5,
               "flattest view of a wall that closes an end");
  visitor.Real("end_uncertainty_m", options.end_uncertainty_m, "m", 0.0, 20.0, "an end known worse than this is open");
}

}  // namespace cairn::slam
