// From the matching table to pairs: every line at most once, the surest first. Cells below the threshold do not count;
// cells that are the maximum of both their row and their column are taken first; where a row's maximum belongs to
// another row, the remaining cell nearest to the run of those already taken is (lines keep their order between scans).
// Source: thesis A 3.5.12.1, Tables 3.4, 3.5, 3.24, 3.25.
#pragma once

#include <vector>

#include "server/slam/matching/vote_table.h"

namespace cairn::slam {

// Ordered by `prev`. Transposing the table transposes the pairs, but for exact ties. `full_turn`: indices go round.
[[nodiscard]] std::vector<LinePair> SelectPairs(const VoteTable& table, double min_votes, bool full_turn);

}  // namespace cairn::slam
