#include "server/maps/layer_disagreement.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace cairn::server {
namespace {

constexpr std::size_t kSide = kTileCells;

using LogOdds = decltype(slam::GridChunk::log_odds);

// The largest of each cell and its neighbours. kUnseen is below all others. The cells at the border stay as they are.
LogOdds LargestAround(const LogOdds& cells) {
  LogOdds of_row = cells;
  for (std::size_t i = 1; i + 1 < cells.size(); ++i) of_row[i] = std::max({cells[i - 1], cells[i], cells[i + 1]});
  LogOdds largest = of_row;
  for (std::size_t i = kSide; i + kSide < cells.size(); ++i)
    largest[i] = std::max({of_row[i - kSide], of_row[i], of_row[i + kSide]});
  return largest;
}

}  // namespace

// Where two robots, or two runs, have placed a wall in neighbouring cells they do not differ, so an occupied cell is
// compared with what the others have seen in the cells around it. Those of other chunks are not looked at.
std::shared_ptr<const TileCells> DisagreementOf(std::span<const slam::GridChunk* const> grids) {
  constexpr int kHalf = 50;
  std::vector<LogOdds> around;
  for (const slam::GridChunk* const grid : grids) around.push_back(LargestAround(grid->log_odds));
  auto cells = std::make_shared<TileCells>();
  cells->fill(kUnknownCell);
  int largest = 0;
  for (std::size_t row = 1; row + 1 < kSide; ++row) {
    for (std::size_t i = row * kSide + 1; i + 1 < (row + 1) * kSide; ++i) {
      std::int16_t high = slam::kUnseen, low = INT16_MAX;
      int seen = 0;
      for (std::size_t grid = 0; grid < grids.size(); ++grid) {
        if (grids[grid]->log_odds[i] == slam::kUnseen) continue;
        ++seen;
        high = std::max(high, grids[grid]->log_odds[i]);
        low = std::min(low, around[grid][i]);
      }
      if (seen < 2) continue;
      const int differs = high <= low ? 0 : slam::OccupancyOf(high) - slam::OccupancyOf(low);
      (*cells)[i] = static_cast<std::uint8_t>(differs > kHalf ? differs : 0);  // What is usual changes no tile.
      largest = std::max(largest, differs);
    }
  }
  return largest > kHalf ? cells : nullptr;
}

}  // namespace cairn::server
