#include <algorithm>
#include <limits>
#include <span>

#include "server/slam/voting/criteria.h"
#include "server/slam/voting/overlap.h"

namespace cairn::slam {
namespace {

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

void VoteByAnglePatterns(const ScanPair& scans, const ToleranceOptions& options, VoteTable& votes) {
  const PatternRule rule{.angles = true, .tolerance = options.pattern_angle_rad, .least_score = 3};
  VoteByPatterns(scans, rule, static_cast<int>(options.pattern_window), votes);
}

void VoteByDistancePatterns(const ScanPair& scans, const ToleranceOptions& options, VoteTable& votes) {
  const PatternRule rule{.angles = false, .tolerance = options.pattern_distance_m, .least_score = 2};
  VoteByPatterns(scans, rule, static_cast<int>(options.pattern_window), votes);
}

}  // namespace cairn::slam
