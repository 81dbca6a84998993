// Selects pairs of lines from the matching table, one to one. Cells below the threshold do not count. Cells
// that are the maximum of both their row and their column are taken first. Of the cells left, the nearest to
// the run of pairs already taken comes next, because lines keep their order between scans.
// Source: thesis A 3.5.12.1, Tables 3.4, 3.5, 3.24, 3.25.
#pragma once

#include <vector>

#include "server/slam/matching/vote_table.h"

namespace cairn::slam {

// The pairs are ordered by `ref`. Transposing the table transposes the pairs, except for exact ties. With
// `full_turn` the first line follows the last one.
[[nodiscard]] std::vector<LinePair> SelectPairs(const VoteTable& table, double min_votes, bool full_turn);

}  // namespace cairn::slam
