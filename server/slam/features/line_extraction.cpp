#include "server/slam/features/line_extraction.h"

#include <algorithm>
#include <cmath>

#include "server/slam/features/split_and_merge.h"
#include "server/slam/features/sweep.h"

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

EndClass EndClassOf(const Sweep& sweep, const LineSegment& segment, const LineOptions& options) {
  const bool right = Ended(sweep, segment, -1, options), left = Ended(sweep, segment, +1, options);
  if (right && left) return EndClass::kBothEnded;
  if (right) return EndClass::kRightEnded;
  return left ? EndClass::kLeftEnded : EndClass::kOpen;
}

std::vector<LineFeature> ExtractLines(std::span<const BeamPoint> points, const Scan& scan, const LineOptions& options) {
  const Sweep sweep(points, scan);
  const std::vector<LineSegment> segments = MergeSegments(sweep, options, SplitIntoSegments(sweep, options));
  std::vector<LineFeature> lines;
  lines.reserve(segments.size());
  for (const LineSegment& segment : segments) lines.push_back(FeatureOf(sweep, segment, options));
  return lines;
}

void Visit(OptionVisitor& visitor, LineOptions& options) {
  visitor.Real("jump_m", options.jump_m, "m", 0.0, 5.0,
               "Neighbouring points whose ranges differ by more belong to different clusters. A larger value joins "
               "separate things; a smaller one breaks rough walls.");
  visitor.Real("grazing_rad", options.grazing_rad, "rad", 0.01, 1.5,
               "Smallest angle between a beam and a wall at which the wall stays one cluster. A smaller value keeps "
               "walls whole that are seen from the side, and joins more separate things.");
  visitor.Real("max_gap_rad", options.max_gap_rad, "rad", 0.0, 1.0,
               "Largest gap of invalid beams within a cluster, at least two beams.");
  visitor.Real("split_m", options.split_m, "m", 0.001, 1.0,
               "A point farther than this from its line splits the line. A larger value smooths over steps and posts.");
  visitor.Real("split_per_m", options.split_per_m, "m/m", 0.0, 0.1, "Added to split_m per metre of range.");
  visitor.Real("merge_angle_rad", options.merge_angle_rad, "rad", 0.0, 1.0,
               "Neighbouring lines with a larger angle between them are never joined.");
  visitor.Real(
      "occlusion_rad", options.occlusion_rad, "rad", 0.0, 3.0,
      "Largest angle that nearer things may hide of a line, at least three beams. A larger value bridges wider posts.");
  visitor.Real("occlusion_m", options.occlusion_m, "m", 0.0, 20.0, "Longest hidden part of a line.");
  visitor.Real("min_length_m", options.min_length_m, "m", 0.01, 10.0,
               "Shortest line that is kept. A larger value keeps only walls.");
  visitor.Integer("min_points", options.min_points, "points", 3, 1000,
                  "Fewest points of a line, however far away it is or however flat it is seen.");
  visitor.Integer("max_points_needed", options.max_points_needed, "points", 3, 1000,
                  "Most points that are asked of a line, however near it is.");
  visitor.Real(
      "max_deviation_m", options.max_deviation_m, "m", 0.001, 1.0,
      "Largest root mean square distance of the points from their line. A larger value accepts plants and people.");
  visitor.Real(
      "min_aspect", options.min_aspect, "", 0.0, 1000.0,
      "Smallest ratio of the length of a line to the deviation of its points. A larger value drops short rough lines.");
  visitor.Integer("correct_below_points", options.correct_below_points, "points", 0, 1000,
                  "A line with at most so many points between two parallel ones is turned to be perpendicular to them. "
                  "0 does this never.");
  visitor.Real("range_sigma_m", options.range_sigma_m, "m", 0.0001, 1.0, "Standard deviation of a range of the laser.");
  visitor.Real("end_gap_m", options.end_gap_m, "m", 0.0, 5.0,
               "An end of a line is closed if the next point lies within this distance, in addition to the spacing of "
               "the beams.");
  visitor.Real("corner_incidence_rad", options.corner_incidence_rad, "rad", 0.01, 1.5,
               "A wall closes the end of another line only if it is seen at a larger angle than this.");
  visitor.Real("end_uncertainty_m", options.end_uncertainty_m, "m", 0.0, 20.0,
               "An end of a line whose place is less certain than this counts as open.");
  visitor.Require(options.min_points <= options.max_points_needed, "min_points", "must not exceed",
                  "max_points_needed");
}

}  // namespace cairn::slam
