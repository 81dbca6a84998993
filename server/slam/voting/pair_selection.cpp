#include "server/slam/voting/pair_selection.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

// Largest distance of a cell from the run of pairs already taken. A line may be missed or split in one of the
// scans, but a cell farther away is a match by chance.
constexpr double kMaxOffRun = 2.5;

// The distance of a cell from the polyline through the pairs already taken, as a difference of (curr - ref).
// The polyline is interpolated along ref + curr, so that rows and columns count alike.
double DistanceToRun(const std::vector<LinePair>& taken, int ref, int curr, int period) {
  if (taken.empty()) return 0.0;
  const double along = ref + curr, across = curr - ref;
  const LinePair *before = nullptr, *after = nullptr;
  for (const LinePair& pair : taken) {
    const int at = pair.ref + pair.curr;
    if (at <= along && (before == nullptr || at > before->ref + before->curr)) before = &pair;
    if (at >= along && (after == nullptr || at < after->ref + after->curr)) after = &pair;
  }
  if (before == nullptr) before = after;
  if (after == nullptr) after = before;
  const double from = before->ref + before->curr, to = after->ref + after->curr;
  const double share = to > from ? (along - from) / (to - from) : 0.0;
  const double expected = (1.0 - share) * (before->curr - before->ref) + share * (after->curr - after->ref);
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
    taken.push_back({.ref = i, .curr = j, .votes = table.At(i, j)});
    row_free[static_cast<std::size_t>(i)] = column_free[static_cast<std::size_t>(j)] = 0;
  };

  // First, the cells without conflict.
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

  // Then the cells with a conflict: the nearest to the run first, and among equals the one with more votes.
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
  std::sort(taken.begin(), taken.end(), [](const LinePair& a, const LinePair& b) { return a.ref < b.ref; });
  return taken;
}

}  // namespace cairn::slam
