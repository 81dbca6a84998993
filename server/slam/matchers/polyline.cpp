#include "server/slam/matchers/polyline.h"

#include <algorithm>
#include <cmath>

#include "server/slam/features/line_fit.h"

namespace cairn::slam {
namespace {

// Sums over a line's points as if they were evenly spread along it.
PointSums SumsOf(const LineFeature& line) {
  const double n = std::max(line.point_count, 2);
  const Eigen::Vector2d mid = line.midpoint(), along = line.direction(), normal = line.left_normal();
  const double var_along = line.length * line.length / 12.0, var_across = line.deviation * line.deviation;
  const Eigen::Matrix2d scatter = var_along * along * along.transpose() + var_across * normal * normal.transpose();
  return {n,
          n * mid.x(),
          n * mid.y(),
          n * (scatter(0, 0) + mid.x() * mid.x()),
          n * (scatter(0, 1) + mid.x() * mid.y()),
          n * (scatter(1, 1) + mid.y() * mid.y())};
}

double FarthestEnd(const LineFeature& from, const LineFeature& line) {
  return std::max(std::abs(from.OffsetOf(line.first)), std::abs(from.OffsetOf(line.last)));
}

bool Collinear(const LineFeature& a, const LineFeature& b, const PolylineOptions& options) {
  if (std::abs(AngleDiff(a.slope, b.slope)) > options.collinear_rad) return false;
  // The shorter line is compared with the longer one, because the slope of a short line is not exact far away
  // from it.
  const LineFeature &longer = a.length < b.length ? b : a, &shorter = a.length < b.length ? a : b;
  if (FarthestEnd(longer, shorter) > options.collinear_m) return false;
  const Eigen::Vector2d along = longer.direction();
  const auto span = [&](const LineFeature& line) { return std::minmax({along.dot(line.first), along.dot(line.last)}); };
  const auto in_longer = span(longer), in_shorter = span(shorter);
  const double gap = std::max(in_longer.first - in_shorter.second, in_shorter.first - in_longer.second);
  return gap <= options.gap_m;
}

LineFeature Join(const LineFeature& a, const LineFeature& b) {
  const FittedLine fit = FitLine(SumsOf(a) + SumsOf(b));
  LineFeature line = a;
  const Eigen::Vector2d hint = a.length < b.length ? b.direction() : a.direction();
  Eigen::Vector2d along(-fit.normal.y(), fit.normal.x());
  if (along.dot(hint) < 0.0) along = -along;
  const LineFeature& right = along.dot(a.first) <= along.dot(b.first) ? a : b;
  const LineFeature& left = along.dot(a.last) >= along.dot(b.last) ? a : b;
  const auto on_line = [&](const Eigen::Vector2d& p) { return (p - fit.DistanceOf(p) * fit.normal).eval(); };
  line.first = on_line(right.first);
  line.last = on_line(left.last);
  line.length = (line.last - line.first).norm();
  line.slope = std::atan2(along.y(), along.x());
  const double side = fit.offset < 0.0 ? -1.0 : 1.0;
  line.distance = side * fit.offset;
  line.normal_angle = WrapAngle(std::atan2(side * fit.normal.y(), side * fit.normal.x()));
  line.deviation = fit.deviation;
  line.point_count = a.point_count + b.point_count;
  line.first_beam = right.first_beam;
  line.last_beam = left.last_beam;
  const bool right_ended = right.ends == EndClass::kRightEnded || right.ends == EndClass::kBothEnded;
  const bool left_ended = left.ends == EndClass::kLeftEnded || left.ends == EndClass::kBothEnded;
  line.ends = right_ended ? (left_ended ? EndClass::kBothEnded : EndClass::kRightEnded)
                          : (left_ended ? EndClass::kLeftEnded : EndClass::kOpen);
  return line;
}

// The point where two lines of a chain meet: their intersection, or the middle between their ends if they are
// nearly parallel.
Eigen::Vector2d JointOf(const LineFeature& a, const LineFeature& b, double reach_m) {
  Eigen::Vector2d between = 0.5 * (a.last + b.first);
  const Eigen::Vector2d u = a.direction(), v = b.direction();
  const double sine = u.x() * v.y() - u.y() * v.x();
  if (std::abs(sine) < std::sin(Radians(15.0))) return between;
  const Eigen::Vector2d to_b = b.first - a.last;
  const Eigen::Vector2d crossing = a.last + (to_b.x() * v.y() - to_b.y() * v.x()) / sine * u;
  return (crossing - between).norm() <= reach_m ? crossing : between;
}

}  // namespace

void Visit(OptionVisitor& visitor, PolylineOptions& options) {
  visitor.Real("collinear_rad", options.collinear_rad, "rad", 0.0, 0.5,
               "Pieces of one line differ at most by this in direction.");
  visitor.Real("collinear_m", options.collinear_m, "m", 0.0, 1.0,
               "The ends of a piece lie at most this far from the line of the other.");
  visitor.Real("gap_m", options.gap_m, "m", 0.0, 10.0,
               "Pieces of one line are at most this far apart. A larger value closes doors.");
  visitor.Real("joint_m", options.joint_m, "m", 0.0, 2.0,
               "Lines whose ends are nearer to each other belong to one chain.");
  visitor.Real("stub_m", options.stub_m, "m", 0.0, 5.0, "Shorter lines that belong to no chain are dropped.");
}

std::optional<LineFeature> JoinCollinear(const LineFeature& a, const LineFeature& b, const PolylineOptions& options) {
  return Collinear(a, b, options) ? std::optional(Join(a, b)) : std::nullopt;
}

std::vector<LineFeature> MergeCollinear(std::vector<LineFeature> lines, const PolylineOptions& options) {
  // A joined line may reach a further piece, so its row is searched again; the loop ends because every join
  // removes a line.
  for (std::size_t a = 0; a < lines.size(); ++a) {
    for (std::size_t b = a + 1; b < lines.size();) {
      if (!Collinear(lines[a], lines[b], options)) {
        ++b;
        continue;
      }
      lines[a] = Join(lines[a], lines[b]);
      lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(b));
      b = a + 1;
    }
  }
  return lines;
}

std::vector<Polyline> PolylinesOf(std::span<const LineFeature> lines, const PolylineOptions& options) {
  const auto meet = [&](std::size_t a, std::size_t b) {
    return (lines[b].first - lines[a].last).norm() <= options.joint_m;
  };
  std::vector<Polyline> chains;
  for (std::size_t k = 0; k < lines.size(); ++k) {
    if (k > 0 && meet(k - 1, k)) {
      chains.back().vertices.back() = JointOf(lines[k - 1], lines[k], options.joint_m);
    } else {
      chains.push_back({{}, {lines[k].first}, false});
    }
    chains.back().lines.push_back(static_cast<int>(k));
    chains.back().vertices.push_back(lines[k].last);
  }
  if (lines.size() < 3 || !meet(lines.size() - 1, 0)) return chains;
  // Joins the last line with the first, across the seam of a full turn.
  const Eigen::Vector2d joint = JointOf(lines.back(), lines.front(), options.joint_m);
  if (chains.size() == 1) {
    chains[0].vertices.front() = chains[0].vertices.back() = joint;
    chains[0].closed = true;
  } else {
    Polyline &last = chains.back(), &first = chains.front();
    last.vertices.back() = joint;
    last.lines.insert(last.lines.end(), first.lines.begin(), first.lines.end());
    last.vertices.insert(last.vertices.end(), first.vertices.begin() + 1, first.vertices.end());
    chains.erase(chains.begin());
  }
  return chains;
}

std::vector<LineFeature> PolylineLines(std::span<const LineFeature> lines, const PolylineOptions& options) {
  std::vector<LineFeature> merged = MergeCollinear({lines.begin(), lines.end()}, options);
  std::vector<bool> lone(merged.size(), false);
  for (const Polyline& chain : PolylinesOf(merged, options))
    if (chain.lines.size() == 1) lone[static_cast<std::size_t>(chain.lines[0])] = true;
  std::vector<LineFeature> kept;
  for (std::size_t k = 0; k < merged.size(); ++k)
    if (!lone[k] || merged[k].length >= options.stub_m) kept.push_back(merged[k]);
  return kept;
}

}  // namespace cairn::slam
