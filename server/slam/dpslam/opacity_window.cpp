#include "server/slam/dpslam/opacity_window.h"

#include <algorithm>

namespace cairn::slam {

OpacityWindow::OpacityWindow(const Ancestry& ancestry, const TileBox& box, const StopRate& rate)
    : ancestry_(ancestry), box_(box), rate_(rate) {
  const std::size_t cells = static_cast<std::size_t>(width()) * static_cast<std::size_t>(height());
  counts_.resize(cells);
  rates_.resize(cells);
}

void OpacityWindow::Show(Ancestry::Id id) {
  ancestry_.LineTo(id, next_line_);
  std::size_t shared = 0;
  while (shared < line_.size() && shared < next_line_.size() && line_[shared] == next_line_[shared]) ++shared;
  for (std::size_t i = line_.size(); i-- > shared;) Apply<-1>(ancestry_.changes(line_[i]));
  for (std::size_t i = shared; i < next_line_.size(); ++i) Apply<+1>(ancestry_.changes(next_line_[i]));
  line_.swap(next_line_);
}

template <int Sign>
void OpacityWindow::Apply(const MapChanges& changes) {
  const MapChanges::Tiles& tiles = changes.tiles();
  auto tile = std::lower_bound(tiles.begin(), tiles.end(), ChangeTileKey{box_.low_y, box_.low_x},
                               [](const auto& have, const ChangeTileKey& key) { return have->key < key; });
  for (; tile != tiles.end() && (*tile)->key.y < box_.low_y + box_.height; ++tile) {
    const int column = (*tile)->key.x - box_.low_x, row = (*tile)->key.y - box_.low_y;
    if (column < 0 || column >= box_.width) continue;
    const auto stride = static_cast<std::size_t>(width());
    const std::size_t corner =
        (static_cast<std::size_t>(row) << kTileBits) * stride + (static_cast<std::size_t>(column) << kTileBits);
    CellCounts* const counts = counts_.data() + corner;
    float* const rates = rates_.data() + corner;
    (*tile)->ForEach([&](std::uint16_t cell, std::uint16_t travel, std::uint16_t stops) {
      const std::size_t at = (cell >> kTileBits) * stride + (cell & (kChangeTileSide - 1));
      CellCounts sum = counts[at];  // Unsigned arithmetic: subtraction undoes addition exactly.
      if constexpr (Sign > 0) {
        sum = {sum.travel + travel, sum.stops + stops};
      } else {
        sum = {sum.travel - travel, sum.stops - stops};
      }
      counts[at] = sum;
      rates[at] = sum == CellCounts{} ? 0.0F : rate_(sum);
    });
  }
}

}  // namespace cairn::slam
