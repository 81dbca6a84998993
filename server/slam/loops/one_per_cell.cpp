#include "server/slam/loops/one_per_cell.h"

#include <cmath>
#include <utility>

namespace cairn::slam {

bool OnePerCell::Takes(const Eigen::Vector2d& p) {
  const auto x = static_cast<std::int64_t>(std::floor(p.x() / cell_m_));
  const auto y = static_cast<std::int64_t>(std::floor(p.y() / cell_m_));
  const auto cell = (static_cast<std::uint64_t>(x) << 32) ^ (static_cast<std::uint64_t>(y) & 0xffffffff);
  std::uint64_t& slot = taken_[SlotOf(cell)];
  if (slot == cell) return false;
  slot = cell;
  if (2 * ++count_ > taken_.size()) Grow();
  return true;
}

std::size_t OnePerCell::SlotOf(std::uint64_t cell) const {
  const std::uint64_t mixed = cell * 0x9e3779b97f4a7c15;  // Its upper bits depend on all bits of the cell.
  const std::size_t mask = taken_.size() - 1;
  std::size_t slot = static_cast<std::size_t>(mixed >> 32) & mask;
  while (taken_[slot] != kNone && taken_[slot] != cell) slot = (slot + 1) & mask;
  return slot;
}

void OnePerCell::Grow() {
  const std::vector<std::uint64_t> before = std::exchange(taken_, std::vector<std::uint64_t>(2 * taken_.size(), kNone));
  for (const std::uint64_t cell : before)
    if (cell != kNone) taken_[SlotOf(cell)] = cell;
}

}  // namespace cairn::slam
