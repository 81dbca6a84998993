// How the grids that several sessions have drawn of the same place become one. Where nothing is known of when each of
// them looked there, sessions of the same time add up, because log odds of independent evidence do. Older evidence may
// be out of date: where a session has seen the same cell later, it counts up to a limit only, so that what was moved
// meanwhile goes after a few looks. Where none has, it stays as it is. Stateless, thread-safe.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

inline constexpr int kLargestSum = 32000;  // In units of GridChunk::log_odds.

inline bool EveryCell(std::size_t /*cell*/) {
  return true;
}

// Adds to a sum those cells of a later grid for which `takes(cell)` is true. Where both have seen a cell, the sum is
// first limited to +-`most`, in units of GridChunk::log_odds.
template <typename Takes = decltype(EveryCell)>
void AddLater(slam::GridChunk& sum, const slam::GridChunk& later, int most, const Takes& takes = EveryCell) {
  // In 16 bits, without branches and with a store for each cell, so that the compiler makes vector instructions of it:
  // with many robots this loop is most of what drawing their map costs. The sum is limited before the evidence is
  // added, so that it never leaves 16 bits.
  using Odds = std::int16_t;
  constexpr Odds kLargest = kLargestSum;
  const auto largest = static_cast<Odds>(std::min(most, kLargestSum)), smallest = static_cast<Odds>(-largest);
  for (std::size_t i = 0; i < sum.log_odds.size(); ++i) {
    const Odds a = sum.log_odds[i], b = later.log_odds[i];
    const auto most_before = static_cast<Odds>(kLargest - std::max(b, Odds{0}));
    const auto least_before = static_cast<Odds>(-kLargest - std::min(b, Odds{0}));
    const Odds believed = std::min(std::max(a, smallest), largest);
    const Odds limited = std::min(std::max(believed, least_before), most_before);
    const auto both = static_cast<Odds>(limited + b);
    const Odds known = a == slam::kUnseen ? b : both;
    sum.log_odds[i] = ((b != slam::kUnseen) & takes(i)) ? known : a;
  }
}

// The same for evidence of one time.
template <typename Takes = decltype(EveryCell)>
void AddBeside(slam::GridChunk& sum, const slam::GridChunk& other, const Takes& takes = EveryCell) {
  AddLater(sum, other, kLargestSum, takes);
}

[[nodiscard]] slam::GridChunk UnseenChunk();

}  // namespace cairn::server
