#include "server/slam/matching/pair_selection.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

// A line may be missed or split in one of the scans; farther off the run a leftover cell is chance.
constexpr double kMaxOffRun = 2.5;

// How far a cell is from the polyline through the pairs taken, as a difference of (curr - prev). Interpolated along
// prev + curr, so that rows and columns count alike.
double DistanceToRun(const std::vector<LinePair>& taken, int prev, int curr, int period) {
  if (taken.empty()) return 0.0;
  const double along = prev + curr, across = curr - prev;
  const LinePair *before = nullptr, *after = nullptr;
  for (const LinePair& pair : taken) {
    const int at = pair.prev + pair.curr;
    if (at <= along && (before == nullptr || at > before->prev + before->curr)) before = &pair;
    if (at >= along && (after == nullptr || at < after->prev + after->curr)) after = &pair;
  }
  if (before == nullptr) before = after;
  if (after == nullptr) after = before;
  const double from = before->prev + before->curr, to = after->prev + after->curr;
  const double share = to > from ? (along - from) / (to - from) : 0.0;
  const double expected = (1.0 - share) * (before->curr - before->prev) + share * (after->curr - after->prev);
  const double distance = std::abs(across - expected);
  return period > 0 ? std::min(distance, std::abs(period - distance)) : distance;
}

}  // namespace

std::vector<LinePair> SelectPairs(const VoteTable& table, double min_votes, bool full_turn) {
  const int rows = table.rows(), columns = table.columns();
  std::vector<LinePair> taken;
  std::vector<char> row_free(static_cast<std::size_t>(rows), 1), column_free(static_cast<std::size_t>(columns), 1);
  const auto open = [&](int i, int j) {
    return row_free[static_cast<std::size_t>(i)] != 0 && column_free[static_cast<std::size_t>(j)] != 0 &&
           table.At(i, j) >= min_votes;
  };
  const auto take = [&](int i, int j) {
    taken.push_back({.prev = i, .curr = j, .votes = table.At(i, j)});
    row_free[static_cast<std::size_t>(i)] = column_free[static_cast<std::size_t>(j)] = 0;
  };

  // Cells without conflict.
  std::vector<int> best_row(static_cast<std::size_t>(columns), -1);
  for (int j = 0; j < columns; ++j) {
    for (int i = 0; i < rows; ++i) {
      int& best = best_row[static_cast<std::size_t>(j)];
      if (best < 0 || table.At(i, j) > table.At(best, j)) best = i;
    }
  }
  for (int i = 0; i < rows; ++i) {
    int best = -1;
    for (int j = 0; j < columns; ++j) {
      if (best < 0 || table.At(i, j) > table.At(i, best)) best = j;
    }
    if (best >= 0 && best_row[static_cast<std::size_t>(best)] == i && open(i, best)) take(i, best);
  }

  // Conflicts: nearest to the run first, then by votes.
  const int period = full_turn ? std::max(rows, columns) : 0;
  for (;;) {
    int best_i = -1, best_j = -1;
    double best_distance = std::numeric_limits<double>::infinity();
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) {
        if (!open(i, j)) continue;
        const double distance = DistanceToRun(taken, i, j, period);
        if (distance > std::min(best_distance, kMaxOffRun)) continue;
        if (distance == best_distance && table.At(i, j) <= table.At(best_i, best_j)) continue;
        best_distance = distance, best_i = i, best_j = j;
      }
    }
    if (best_i < 0) break;
    take(best_i, best_j);
  }
  std::sort(taken.begin(), taken.end(), [](const LinePair& a, const LinePair& b) { return a.prev < b.prev; });
  return taken;
}

}  // namespace cairn::slam
