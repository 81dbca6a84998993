#include "server/slam/voting/criteria.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "common/geometry/angle.h"

namespace cairn::slam {
namespace {

// The long lines that cannot be confused with a similar line nearby.
std::vector<int> StandingOut(const std::vector<LineFeature>& lines, const ToleranceOptions& options) {
  std::vector<int> found;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].length < options.long_line_m) continue;
    bool has_rival = false;
    for (std::size_t k = 0; k < lines.size() && !has_rival; ++k) {
      if (k == i || lines[k].length < options.long_line_ratio * lines[i].length) continue;
      constexpr double kSameSlope = Radians(15.0);
      if (std::abs(AngleDiff(lines[k].slope, lines[i].slope)) > kSameSlope) continue;
      has_rival = std::abs(lines[i].OffsetOf(lines[k].midpoint())) < options.long_line_apart_m;
    }
    if (!has_rival) found.push_back(static_cast<int>(i));
  }
  return found;
}

struct Parallel {
  int a = 0, b = 0;
  double offset = 0.0;  // How far b lies to the left of a.
  bool same_way = false;
  OverlapType overlap = OverlapType::kOverlap;
};

// Pairs of parallel lines, ordered by offset. With `both_orders` each pair is also listed in reversed order.
std::vector<Parallel> ParallelsOf(const std::vector<LineFeature>& lines, const ToleranceOptions& options,
                                  bool both_orders) {
  // Two parts of one wall are not a pair, because their distance is noise.
  constexpr double kLeastApart = 0.02;
  std::vector<Parallel> parallels;
  const int count = static_cast<int>(lines.size());
  for (int a = 0; a < count; ++a) {
    for (int b = both_orders ? 0 : a + 1; b < count; ++b) {
      if (a == b) continue;
      const LineFeature &line_a = lines[static_cast<std::size_t>(a)], &line_b = lines[static_cast<std::size_t>(b)];
      if (std::abs(LineAngleDiff(line_a.slope, line_b.slope)) > options.parallel_angle_rad) continue;
      const bool same_way = line_a.direction().dot(line_b.direction()) > 0.0;
      // The mean of the two distances of a midpoint from the other line; they differ if the lines are not
      // exactly parallel.
      const double from_b = line_b.OffsetOf(line_a.midpoint());
      const double offset = 0.5 * (line_a.OffsetOf(line_b.midpoint()) + (same_way ? -from_b : from_b));
      if (std::abs(offset) < kLeastApart) continue;
      parallels.push_back({a, b, offset, same_way, OverlapTypeOf(line_a, line_b)});
    }
  }
  std::sort(parallels.begin(), parallels.end(),
            [](const Parallel& x, const Parallel& y) { return x.offset < y.offset; });
  return parallels;
}

using Taken = std::vector<std::pair<int, int>>;

struct PatternRule {
  bool angles = true;
  double tolerance = 0.0;
  int least_score = 0;  // With fewer agreeing entries a row gets no votes.
};

std::span<const double> RowOf(const LinePattern& pattern, const PatternRule& rule) {
  const auto& row = rule.angles ? pattern.angle : pattern.corner_distance;
  return {row.data(), static_cast<std::size_t>(pattern.count)};
}

// One of the two passes: compares every row of `walked` with the same row and the next rows of `other`
// (Tables 3.15, 3.21), and votes for the lines of the best row. `vote(w, o, inner)` receives a pair of lines
// (walked, other).
template <typename Possible, typename Vote>
void VoteOnePass(const ScanFeatures& walked, const ScanFeatures& other, const PatternRule& rule, int window,
                 const Possible& possible, const Vote& vote) {
  const int rows = static_cast<int>(walked.patterns.size()), columns = static_cast<int>(other.patterns.size());
  Taken taken, best_taken;
  for (int w = 0; w < rows; ++w) {
    const auto row = RowOf(walked.patterns[static_cast<std::size_t>(w)], rule);
    int best = 0, best_other = -1;
    bool tie = false;
    for (int shift = 0; shift < std::min(window, columns); ++shift) {
      int o = w + shift;
      if (o >= columns && !other.full_turn) break;
      o %= columns;
      if (!possible(w, o)) continue;
      taken.clear();
      const int score = PatternOverlap(row, RowOf(other.patterns[static_cast<std::size_t>(o)], rule), rule.tolerance,
                                       rule.angles, &taken);
      if (score == best) tie = true;
      if (score <= best) continue;
      best = score;
      best_other = o;
      tie = false;
      best_taken = taken;
    }
    if (best < rule.least_score || tie) continue;
    const double inner = best - rule.least_score + 1;
    const auto vote_line = [&](int w_line, int o_line) {
      w_line %= rows;
      o_line %= columns;
      if (possible(w_line, o_line)) vote(w_line, o_line, inner);
      return w_line;
    };
    vote_line(w, best_other);
    for (const auto& [p, m] : best_taken) vote_line(w + 1 + p, best_other + 1 + m);
    if (rule.angles) continue;
    // A corner is formed by two lines. The second line of the last corner is not among the voted ones and
    // gets its vote here.
    const auto vote_partner = [&](int w_line, int o_line) {
      const int w_with = walked.patterns[static_cast<std::size_t>(w_line % rows)].corner_with;
      const int o_with = other.patterns[static_cast<std::size_t>(o_line % columns)].corner_with;
      if (w_with >= 0 && o_with >= 0) vote_line(w_with, o_with);
    };
    const auto last = best_taken.back();
    vote_partner(w + 1 + last.first, best_other + 1 + last.second);
  }
}

void VoteByPatterns(const ScanPair& scans, const PatternRule& rule, int window, VoteTable& votes) {
  // It is not known yet whether the robot turned left or right. One pass therefore compares with later rows
  // of the current scan, the other with later rows of the previous scan.
  VoteOnePass(
      scans.ref, scans.curr, rule, window, [&](int p, int c) { return scans.candidates.Has(p, c); },
      [&](int p, int c, double inner) { votes.At(p, c) += inner; });
  VoteOnePass(
      scans.curr, scans.ref, rule, window, [&](int c, int p) { return scans.candidates.Has(p, c); },
      [&](int c, int p, double inner) { votes.At(p, c) += inner; });
}

}  // namespace

OverlapType OverlapTypeOf(const LineFeature& a, const LineFeature& b) {
  const Eigen::Vector2d along = a.direction();
  const double first = along.dot(b.first - a.first), last = along.dot(b.last - a.first);
  if (first > a.length && last > a.length) return OverlapType::kBeyondLast;
  if (first < 0.0 && last < 0.0) return OverlapType::kBeforeFirst;
  return OverlapType::kOverlap;
}

int PatternOverlap(std::span<const double> walked, std::span<const double> other, double tolerance, bool angles,
                   std::vector<std::pair<int, int>>* taken) {
  int score = 0;
  std::size_t next = 0;
  for (std::size_t p = 0; p < walked.size() && next < other.size(); ++p) {
    if (std::isnan(walked[p])) continue;
    for (std::size_t m = next; m < other.size(); ++m) {
      if (std::isnan(other[m])) continue;
      const double difference = angles ? AngleDiff(walked[p], other[m]) : walked[p] - other[m];
      if (std::abs(difference) > tolerance) continue;
      if (taken != nullptr) taken->emplace_back(static_cast<int>(p), static_cast<int>(m));
      ++score;
      next = m + 1;
      break;
    }
  }
  return score;
}

CandidateTable VoteByPossibility(const ScanFeatures& ref, const ScanFeatures& curr, const Pose2& T_ref_curr_odometry,
                                 const CandidateOptions& options, const VoteWeightOptions& weights, VoteTable& votes) {
  const int rows = static_cast<int>(ref.lines.size()), columns = static_cast<int>(curr.lines.size());
  CandidateTable candidates(rows, columns);
  for (int j = 0; j < columns; ++j) {
    const LineFeature& line = curr.lines[static_cast<std::size_t>(j)];
    const Eigen::Vector2d mid_curr = T_ref_curr_odometry * line.midpoint();
    const double slope = WrapAngle(line.slope + T_ref_curr_odometry.theta);
    const Eigen::Vector2d normal(-std::sin(slope), std::cos(slope));
    for (int i = 0; i < rows; ++i) {
      const LineFeature& other = ref.lines[static_cast<std::size_t>(i)];
      const double turn = std::abs(AngleDiff(other.slope, slope));
      double vote = weights.impossible;
      if (turn <= options.max_rotation_rad) {
        // The offset is the mean distance of each line's midpoint from the other line, so that swapping the
        // scans changes nothing. The midpoints may lie far apart along the wall; the error that the unknown
        // turn causes over that distance is allowed in addition.
        const Eigen::Vector2d between = mid_curr - other.midpoint();
        const double offset = 0.5 * std::abs((other.left_normal() + normal).dot(between));
        const double allowed = options.max_translation_m + 0.5 * turn * between.norm();
        if (offset <= allowed) {
          candidates.Add(i, j);
          const double off = turn / std::max(options.max_rotation_rad, 1e-9) + offset / std::max(allowed, 1e-9);
          vote = weights.possible * (1.0 + std::max(0.0, 1.0 - off));
        }
      }
      votes.At(i, j) = vote;
    }
  }
  return candidates;
}

void VoteByLongLines(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes) {
  const std::vector<int> ref = StandingOut(scans.ref.lines, options), curr = StandingOut(scans.curr.lines, options);
  const auto rivals = [&](int i, int j) {
    int count = 0;
    for (const int k : ref) count += k != i && scans.candidates.Has(k, j) ? 1 : 0;
    for (const int k : curr) count += k != j && scans.candidates.Has(i, k) ? 1 : 0;
    return count;
  };
  for (const int i : ref) {
    for (const int j : curr) {
      if (scans.candidates.Has(i, j)) votes.At(i, j) += rivals(i, j) == 0 ? unique : 1.0;
    }
  }
}

void VoteByRealCorners(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes) {
  struct Agreement {
    std::size_t ref, curr;
  };
  std::vector<Agreement> agreements;
  std::vector<int> ref_count(scans.ref.corners.size(), 0), curr_count(scans.curr.corners.size(), 0);
  for (std::size_t i = 0; i < scans.ref.corners.size(); ++i) {
    const CornerFeature& ref = scans.ref.corners[i];
    if (!ref.real) continue;
    for (std::size_t j = 0; j < scans.curr.corners.size(); ++j) {
      const CornerFeature& curr = scans.curr.corners[j];
      if (!curr.real || std::abs(AngleDiff(ref.angle, curr.angle)) > options.corner_angle_rad) continue;
      // If both pairs of lines are possible, so is the pair of corners.
      if (!scans.candidates.Has(ref.line_a, curr.line_a) || !scans.candidates.Has(ref.line_b, curr.line_b)) continue;
      agreements.push_back({i, j});
      ++ref_count[i];
      ++curr_count[j];
    }
  }
  for (const Agreement& agreement : agreements) {
    const CornerFeature &ref = scans.ref.corners[agreement.ref], &curr = scans.curr.corners[agreement.curr];
    const bool only_one = ref_count[agreement.ref] == 1 && curr_count[agreement.curr] == 1;
    // Right angles are common, so a unique corner counts half as much as a unique pair in criterion 4.
    const double vote = only_one ? 0.5 * unique : 1.0;
    votes.At(ref.line_a, curr.line_a) += vote;
    votes.At(ref.line_b, curr.line_b) += vote;
  }
}

void VoteByParallels(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes) {
  // In a full-turn scan either line of a pair may come first; otherwise the sweep keeps their order.
  const std::vector<Parallel> ref = ParallelsOf(scans.ref.lines, options, false);
  const std::vector<Parallel> curr = ParallelsOf(scans.curr.lines, options, scans.curr.full_turn);
  struct Agreement {
    std::size_t ref, curr;
  };
  std::vector<Agreement> agreements;
  std::vector<int> ref_count(ref.size(), 0), curr_count(curr.size(), 0);
  std::size_t from = 0;
  for (std::size_t i = 0; i < ref.size(); ++i) {
    while (from < curr.size() && curr[from].offset < ref[i].offset - options.parallel_distance_m) ++from;
    for (std::size_t j = from; j < curr.size() && curr[j].offset <= ref[i].offset + options.parallel_distance_m; ++j) {
      if (ref[i].same_way != curr[j].same_way) continue;
      if (!scans.candidates.Has(ref[i].a, curr[j].a) || !scans.candidates.Has(ref[i].b, curr[j].b)) continue;
      agreements.push_back({i, j});
      ++ref_count[i];
      ++curr_count[j];
    }
  }
  for (const Agreement& agreement : agreements) {
    const Parallel &before = ref[agreement.ref], &now = curr[agreement.curr];
    double vote = ref_count[agreement.ref] == 1 && curr_count[agreement.curr] == 1 ? unique : 1.0;
    if (before.overlap == now.overlap) vote += 1.0;
    votes.At(before.a, now.a) += vote;
    votes.At(before.b, now.b) += vote;
  }
}

double EndpointTolerance(const LineFeature& ref, const LineFeature& curr, double angle_step_rad) {
  const auto spacing = [&](const LineFeature& line) {
    const double range = line.midpoint().norm();
    const double sin_incidence = std::max(line.distance / std::max(range, 1e-9), 0.2);
    return range * std::tan(angle_step_rad) / sin_incidence;
  };
  return 2.0 * 2.0 * std::max(spacing(ref), spacing(curr));
}

void VoteByLengths(const ScanPair& scans, const ToleranceOptions& options, double unique, VoteTable& votes) {
  const double step = std::max(scans.ref.angle_step_rad, scans.curr.angle_step_rad);
  const int rows = static_cast<int>(scans.ref.lines.size()), columns = static_cast<int>(scans.curr.lines.size());
  struct Agreement {
    int ref, curr;
  };
  std::vector<Agreement> agreements;
  std::vector<int> ref_count(scans.ref.lines.size(), 0), curr_count(scans.curr.lines.size(), 0);
  for (int i = 0; i < rows; ++i) {
    const LineFeature& ref = scans.ref.lines[static_cast<std::size_t>(i)];
    if (ref.ends != EndClass::kBothEnded) continue;
    for (int j = 0; j < columns; ++j) {
      const LineFeature& curr = scans.curr.lines[static_cast<std::size_t>(j)];
      if (curr.ends != EndClass::kBothEnded || !scans.candidates.Has(i, j)) continue;
      const double tolerance = options.length_floor_m + EndpointTolerance(ref, curr, step);
      const double difference = std::abs(ref.length - curr.length);
      if (difference <= tolerance) {
        agreements.push_back({i, j});
        ++ref_count[static_cast<std::size_t>(i)];
        ++curr_count[static_cast<std::size_t>(j)];
      } else if (difference > tolerance + options.length_negative_m) {
        votes.At(i, j) -= 1.0;
      }
    }
  }
  for (const Agreement& agreement : agreements) {
    const bool only_one = ref_count[static_cast<std::size_t>(agreement.ref)] == 1 &&
                          curr_count[static_cast<std::size_t>(agreement.curr)] == 1;
    votes.At(agreement.ref, agreement.curr) += only_one ? unique : 1.0;
  }
}

void VoteByAnglePatterns(const ScanPair& scans, const ToleranceOptions& options, VoteTable& votes) {
  const PatternRule rule{.angles = true, .tolerance = options.pattern_angle_rad, .least_score = 3};
  VoteByPatterns(scans, rule, static_cast<int>(options.pattern_window), votes);
}

void VoteByDistancePatterns(const ScanPair& scans, const ToleranceOptions& options, VoteTable& votes) {
  const PatternRule rule{.angles = false, .tolerance = options.pattern_distance_m, .least_score = 2};
  VoteByPatterns(scans, rule, static_cast<int>(options.pattern_window), votes);
}

}  // namespace cairn::slam
