#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/features/split_and_merge.h"

namespace cairn::slam {
namespace {

constexpr double kParallelRad = Radians(4.0);

double LengthOf(const Sweep& sweep, const LineSegment& segment) {
  return (sweep.hit(segment.end - 1).p_robot - sweep.hit(segment.begin).p_robot).norm();
}

constexpr int kUnowned = -1;
// Most segments between two parts of a wall, for instance those of a person.
constexpr int kMaxSkippedSegments = 4;

enum class Side { kNearer, kOn, kFarther };

class Merger {
 public:
  Merger(const Sweep& sweep, const LineOptions& options, SplitResult split)
      : sweep_(sweep),
        options_(options),
        segments_(std::move(split.segments)),
        owner_(std::move(split.owner)),
        max_occluded_(sweep.BeamsIn(options.occlusion_rad, 3)) {}

  void JoinCollinear();
  void Lengthen();
  [[nodiscard]] std::vector<LineSegment> StrongOnes() const;

 private:
  int& Owner(int i) { return owner_[static_cast<std::size_t>(sweep_.Wrap(i))]; }
  Side SideOf(const FittedLine& line, const BeamPoint& hit) const;
  bool OnlyOccluded(const FittedLine& line, int from, int to) const;
  bool Join(int a, int b);
  void LengthenEnd(int k, int direction);
  void Claim(int k, int i, int direction);
  bool IsStrong(const LineSegment& segment) const;

  const Sweep& sweep_;
  const LineOptions& options_;
  std::vector<LineSegment> segments_;
  std::vector<int> owner_;  // Per hit: index of its segment in segments_, or kUnowned.
  const int max_occluded_;
};

Side Merger::SideOf(const FittedLine& line, const BeamPoint& hit) const {
  const double distance = line.DistanceOf(hit.p_robot);
  if (std::abs(distance) <= SplitDistance(hit.range_m, options_)) return Side::kOn;
  return (distance > 0.0) == (line.DistanceOf(sweep_.laser()) > 0.0) ? Side::kNearer : Side::kFarther;
}

// True if everything that the laser saw between the hits `from` and `to` lies on the line or in front of it,
// and if at most max_occluded_ beams are hidden or lost.
bool Merger::OnlyOccluded(const FittedLine& line, int from, int to) const {
  int occluded = 0;
  for (int i = from; i < to; ++i) {
    const SweepGap& gap = sweep_.GapAfter(i);
    if (gap.to_edge || gap.no_returns > kToleratedDropouts) return false;
    occluded += gap.beams - 1;
    if (i + 1 == to) break;
    const Side side = SideOf(line, sweep_.hit(i + 1));
    if (side == Side::kFarther) return false;
    if (side == Side::kNearer) ++occluded;
  }
  return occluded <= max_occluded_;
}

bool Merger::Join(int a, int b) {
  LineSegment& first = segments_[static_cast<std::size_t>(a)];
  LineSegment& second = segments_[static_cast<std::size_t>(b)];
  // Not zero if the two segments lie on either side of the seam.
  const int shift = second.begin < first.begin ? sweep_.size() : 0;
  if (second.begin + shift < first.end || second.end + shift - first.begin > sweep_.size()) return false;
  // Two very short segments fit nearly any line, so at least one of them must have enough points for a line
  // of its own.
  if (std::max(first.count(), second.count()) < options_.min_points) return false;
  const double cos_angle = std::abs(first.line.normal.dot(second.line.normal));
  const bool slope_counts = std::min(first.count(), second.count()) >= options_.min_points;
  if (slope_counts && cos_angle < std::cos(options_.merge_angle_rad)) return false;

  LineSegment joined{.begin = first.begin, .end = second.end + shift, .sums = first.sums + second.sums, .line = {}};
  joined.line = FitLine(joined.sums);
  const Eigen::Vector2d gap = sweep_.hit(second.begin).p_robot - sweep_.hit(first.end - 1).p_robot;
  const double spacing = SpacingAt(joined.line, sweep_.laser(), sweep_.hit(second.begin).p_robot, sweep_.step());
  if (gap.norm() > std::max(options_.occlusion_m, 4.0 * spacing)) return false;
  for (int i = joined.begin; i < joined.end; ++i) {
    if (Owner(i) != a && Owner(i) != b) continue;
    if (SideOf(joined.line, sweep_.hit(i)) != Side::kOn) return false;
  }
  if (!OnlyOccluded(joined.line, first.end - 1, second.begin + shift)) return false;
  // A step between two straight parts raises the joint deviation before it raises the largest distance.
  const double apart = std::max({first.line.deviation, second.line.deviation, options_.range_sigma_m});
  if (slope_counts && joined.line.deviation > 1.5 * apart) return false;

  for (int i = second.begin; i < second.end; ++i) {
    if (Owner(i) == b) Owner(i) = a;
  }
  first = joined;
  second.alive = false;
  return true;
}

void Merger::JoinCollinear() {
  const int count = static_cast<int>(segments_.size());
  for (int a = 0; a < count; ++a) {
    if (!segments_[static_cast<std::size_t>(a)].alive) continue;
    int skipped = 0;
    for (int step = 1; step < count && skipped <= kMaxSkippedSegments; ++step) {
      const int b = a + step;
      if (b >= count && !sweep_.full_turn()) break;
      if (!segments_[static_cast<std::size_t>(b % count)].alive) continue;
      if (Join(a, b % count)) {
        skipped = 0;
      } else {
        ++skipped;
      }
    }
  }
}

// True if the segment is long and straight enough, and has as many points as a wall of the shortest accepted
// length would have here: few if it is far away or seen edge-on, many if it is near.
bool Merger::IsStrong(const LineSegment& segment) const {
  const Eigen::Vector2d first = sweep_.hit(segment.begin).p_robot, last = sweep_.hit(segment.end - 1).p_robot;
  const double length = (last - first).norm();
  if (length < options_.min_length_m) return false;
  if (segment.line.deviation > options_.max_deviation_m) return false;
  if (segment.line.deviation * options_.min_aspect > length) return false;
  const double spacing = SpacingAt(segment.line, sweep_.laser(), segment.line.centroid, sweep_.step());
  const int expected = static_cast<int>(std::min(options_.min_length_m / spacing, 1e6));
  const int needed = std::clamp(expected, static_cast<int>(options_.min_points),
                                static_cast<int>(std::max(options_.min_points, options_.max_points_needed)));
  return segment.count() >= needed;
}

void Merger::Claim(int k, int i, int direction) {
  LineSegment& segment = segments_[static_cast<std::size_t>(k)];
  const int previous = Owner(i);
  if (previous != kUnowned) {
    // The hit was at the end of a weaker segment, which loses it.
    LineSegment& stub = segments_[static_cast<std::size_t>(previous)];
    if (stub.count() <= 2) {
      stub.alive = false;
      for (int j = stub.begin; j < stub.end; ++j) {
        if (Owner(j) == previous) Owner(j) = kUnowned;
      }
    } else {
      PointSums one;
      one.Add(sweep_.hit(i).p_robot);
      stub.sums = stub.sums - one;
      if (sweep_.Wrap(stub.begin) == sweep_.Wrap(i)) {
        do {
          ++stub.begin;
        } while (Owner(stub.begin) != previous);
      } else if (sweep_.Wrap(stub.end - 1) == sweep_.Wrap(i)) {
        do {
          --stub.end;
        } while (Owner(stub.end - 1) != previous);
      }
      stub.line = FitLine(stub.sums);
    }
  }
  Owner(i) = k;
  segment.sums.Add(sweep_.hit(i).p_robot);
  if (direction > 0) segment.end = i + 1;
  if (direction < 0) segment.begin = i;
}

// Adds the "points continued from the end of the line": points on the line are added, points in front of it
// are skipped, and a point behind it ends the search. After a skipped point a single hit on the line may be
// chance, so two in a row are required.
void Merger::LengthenEnd(int k, int direction) {
  LineSegment& segment = segments_[static_cast<std::size_t>(k)];
  int end = direction > 0 ? segment.end - 1 : segment.begin;
  int at = end, occluded = 0, pending = end;
  bool has_pending = false;
  for (int walked = 0; walked < sweep_.size() - 1; ++walked) {
    const SweepGap& gap = direction > 0 ? sweep_.GapAfter(at) : sweep_.GapBefore(at);
    if (gap.to_edge || gap.no_returns > kToleratedDropouts) return;
    const BeamPoint& hit = sweep_.hit(at += direction);
    const int owner = Owner(at);
    if (owner == k) return;  // The search has gone all the way round.
    occluded += gap.beams - 1;
    const Side side = SideOf(segment.line, hit);
    const double spacing = SpacingAt(segment.line, sweep_.laser(), hit.p_robot, sweep_.step());
    const double reach = (hit.p_robot - sweep_.hit(end).p_robot).norm();
    if (side == Side::kFarther || reach > std::max(options_.occlusion_m, 4.0 * spacing)) return;
    const bool supported =
        std::abs(segment.line.DistanceOf(hit.p_robot)) <= EndDistance(segment.line, hit.range_m, options_);
    if (side == Side::kNearer || !supported ||
        (owner != kUnowned && IsStrong(segments_[static_cast<std::size_t>(owner)]))) {
      has_pending = false;
      if (++occluded > max_occluded_) return;
    } else if (occluded > 0 && !has_pending) {
      pending = at;
      has_pending = true;
    } else {
      if (has_pending) Claim(k, pending, direction);
      Claim(k, at, direction);
      segment.line = FitLine(segment.sums);
      end = at;
      has_pending = false;
      occluded = 0;
    }
  }
}

void Merger::Lengthen() {
  for (std::size_t k = 0; k < segments_.size(); ++k) {
    if (!segments_[k].alive || !IsStrong(segments_[k])) continue;
    LengthenEnd(static_cast<int>(k), -1);
    LengthenEnd(static_cast<int>(k), +1);
  }
}

std::vector<LineSegment> Merger::StrongOnes() const {
  std::vector<LineSegment> strong;
  for (const LineSegment& segment : segments_) {
    if (segment.alive && IsStrong(segment)) strong.push_back(segment);
  }
  return strong;
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

std::vector<LineSegment> MergeSegments(const Sweep& sweep, const LineOptions& options, SplitResult split) {
  Merger merger(sweep, options, std::move(split));
  merger.JoinCollinear();
  merger.Lengthen();
  std::vector<LineSegment> segments = merger.StrongOnes();
  // Lengthening may have moved a segment across the seam; `begin` is brought back into [0, size()).
  for (LineSegment& segment : segments) {
    if (segment.begin < 0) segment.begin += sweep.size(), segment.end += sweep.size();
    if (segment.begin >= sweep.size()) segment.begin -= sweep.size(), segment.end -= sweep.size();
  }
  std::sort(segments.begin(), segments.end(),
            [](const LineSegment& a, const LineSegment& b) { return a.begin < b.begin; });
  StraightenBetweenParallels(sweep, options, segments);
  return segments;
}

}  // namespace cairn::slam
