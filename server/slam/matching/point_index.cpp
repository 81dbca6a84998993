#include "server/slam/matching/point_index.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace cairn::slam {
namespace {

// With smaller cells a search compares fewer points where a wall is near, and looks into more cells where there is
// none.
constexpr double kCellM = 0.125;
constexpr std::size_t kFirstSlots = 1024;

std::int32_t CellOf(double coordinate_m) {
  return static_cast<std::int32_t>(std::floor(coordinate_m / kCellM));
}

// REQUIRES: value is finite and not negative.
double NextLarger(double value) {
  return std::bit_cast<double>(std::bit_cast<std::uint64_t>(value) + 1);
}

// Where a place lies in its cell, along one axis: how far the cells `offset` cells away are at least.
struct Borders {
  explicit Borders(double coordinate_m, std::int32_t cell) : low_m(coordinate_m - cell * kCellM) {}
  [[nodiscard]] double nearest_m() const { return std::min(low_m, kCellM - low_m); }
  [[nodiscard]] double GapTo(std::int32_t offset) const {
    // Rounding must not exclude a cell that holds a point just as near as the bound.
    constexpr double kRoundingM = 1e-7;
    if (offset == 0) return 0.0;
    return std::max(0.0, (offset < 0 ? low_m - (offset + 1) * kCellM : offset * kCellM - low_m) - kRoundingM);
  }
  double low_m;
};

}  // namespace

void PointIndex::EmptyRings::Clear() {
  std::fill(rings_.begin(), rings_.end(), static_cast<std::uint8_t>(kMost));
}

// From now on the cell holds a point.
void PointIndex::EmptyRings::Fill(std::int32_t x, std::int32_t y) {
  if (rings_.empty()) rings_.assign(static_cast<std::size_t>(kSide * kSide), kMost);
  if (Around(x, y) == 0) return;
  for (std::int32_t j = 1 - kMost; j < kMost; ++j) {
    std::uint8_t* row = rings_.data() + ((y + j) & (kSide - 1)) * kSide;
    for (std::int32_t i = 1 - kMost; i < kMost; ++i) {
      std::uint8_t& rings = row[(x + i) & (kSide - 1)];
      rings = std::min(rings, static_cast<std::uint8_t>(std::max(std::abs(i), std::abs(j))));
    }
  }
}

std::int32_t PointIndex::EmptyRings::Around(std::int32_t x, std::int32_t y) const {
  return rings_[static_cast<std::size_t>((y & (kSide - 1)) * kSide + (x & (kSide - 1)))];
}

PointIndex::PointIndex(std::span<const SurfacePoint> points) : table_(kFirstSlots) {
  for (const SurfacePoint& point : points) Add(point);
}

void PointIndex::Clear() {
  std::fill(table_.begin(), table_.end(), Cell{});
  cells_ = 0;
  empty_rings_.Clear();
  blocks_.clear();
  points_.clear();
  dropped_ = 0;
}

// The slot of a cell, or the free one where it belongs.
std::size_t PointIndex::SlotOf(std::int32_t x, std::int32_t y) const {
  const std::size_t mask = table_.size() - 1;
  std::uint32_t hash = static_cast<std::uint32_t>(x) * 0x9E3779B1U ^ static_cast<std::uint32_t>(y) * 0x85EBCA77U;
  hash ^= hash >> 15;
  std::size_t slot = hash & mask;
  while (table_[slot].newest >= 0 && (table_[slot].x != x || table_[slot].y != y)) slot = (slot + 1) & mask;
  return slot;
}

void PointIndex::Grow() {
  const std::vector<Cell> old = std::exchange(table_, std::vector<Cell>(2 * table_.size()));
  for (const Cell& cell : old)
    if (cell.newest >= 0) table_[SlotOf(cell.x, cell.y)] = cell;
}

void PointIndex::Add(const SurfacePoint& point) {
  if (2 * cells_ >= table_.size()) Grow();
  const std::int32_t x = CellOf(point.p.x()), y = CellOf(point.p.y());
  Cell& cell = table_[SlotOf(x, y)];
  const bool first = cell.newest < 0;
  if (first || blocks_[static_cast<std::size_t>(cell.newest)].size == Block::kPoints) {
    blocks_.emplace_back().older = cell.newest;
    cell = {x, y, static_cast<std::int32_t>(blocks_.size()) - 1};
  }
  if (first) {
    ++cells_;
    empty_rings_.Fill(x, y);
  }
  Block& block = blocks_[static_cast<std::size_t>(cell.newest)];
  const auto at = static_cast<std::size_t>(block.size++);
  block.x[at] = static_cast<float>(point.p.x() - x * kCellM);
  block.y[at] = static_cast<float>(point.p.y() - y * kCellM);
  block.point[at] = static_cast<std::int32_t>(points_.size());
  points_.push_back(point);
}

void PointIndex::DropOldest(std::size_t count) {
  dropped_ += count;
  if (2 * dropped_ < points_.size()) return;
  const std::vector<SurfacePoint> kept(points_.begin() + static_cast<std::ptrdiff_t>(dropped_), points_.end());
  Clear();
  for (const SurfacePoint& point : kept) Add(point);
}

// Single precision is exact enough to exclude a point, with this margin: distances within a search are below a few
// metres, so that their rounding is below a micrometre.
void PointIndex::Best::Set(double squared, std::int32_t at) {
  constexpr double kRoundingM = 2e-6;
  squared_m2 = squared;
  point = at;
  const double reach_m = std::sqrt(squared) * (1.0 + 1e-6) + kRoundingM;
  may_be_nearer_m2 = static_cast<float>(reach_m * reach_m * (1.0 + 1e-6));
}

void PointIndex::LookInto(std::int32_t x, std::int32_t y, const Eigen::Vector2d& p, Best& best) const {
  const auto dropped = static_cast<std::int32_t>(dropped_);
  const auto p_x = static_cast<float>(p.x() - x * kCellM), p_y = static_cast<float>(p.y() - y * kCellM);
  std::int32_t left = kMaxInCell;
  for (std::int32_t b = table_[SlotOf(x, y)].newest; b >= 0 && left > 0;) {
    const Block& block = blocks_[static_cast<std::size_t>(b)];
    if (block.point[static_cast<std::size_t>(block.size) - 1] < dropped) return;
    std::int32_t candidates = 0;
    std::array<std::int32_t, Block::kPoints> candidate;
    for (std::size_t i = 0; i < Block::kPoints; ++i) {
      const float dx = block.x[i] - p_x, dy = block.y[i] - p_y;
      candidate[i] = dx * dx + dy * dy <= best.may_be_nearer_m2 ? 1 : 0;
      candidates |= candidate[i];
    }
    if (candidates != 0) {
      const std::int32_t end = std::max(0, block.size - left);
      for (std::int32_t n = block.size; n-- > end;) {
        const auto i = static_cast<std::size_t>(n);
        if (candidate[i] == 0 || block.point[i] < dropped) continue;
        const double squared_m2 = (points_[static_cast<std::size_t>(block.point[i])].p - p).squaredNorm();
        if (squared_m2 < best.squared_m2) best.Set(squared_m2, block.point[i]);
      }
    }
    left -= block.size;
    b = block.older;
  }
}

const SurfacePoint* PointIndex::Nearest(const Eigen::Vector2d& p, double max_distance_m, std::int32_t& likely) const {
  if (points_.empty()) return nullptr;
  Best best(max_distance_m * max_distance_m);
  if (likely >= static_cast<std::int32_t>(dropped_) && likely < static_cast<std::int32_t>(points_.size())) {
    // The least bound below which the point itself lies, so that of equally near points the same one counts as ever.
    const double bound_m2 = NextLarger((points_[static_cast<std::size_t>(likely)].p - p).squaredNorm());
    if (bound_m2 < best.squared_m2) best.Set(bound_m2, kNone);
  }
  const std::int32_t x = CellOf(p.x()), y = CellOf(p.y());
  const Borders across(p.x(), x), along(p.y(), y);
  const double border_m = std::min(across.nearest_m(), along.nearest_m());
  const std::int32_t empty = empty_rings_.Around(x, y);
  if (empty == 0) LookInto(x, y, p, best);
  for (std::int32_t ring = std::max(1, empty);; ++ring) {
    const double least_m = std::max(0.0, (ring - 1) * kCellM + border_m - 1e-7);
    if (least_m * least_m >= best.squared_m2) break;
    for (std::int32_t j = -ring; j <= ring; ++j) {
      const double gap_y_m = along.GapTo(j);
      const std::int32_t step = std::abs(j) == ring ? 1 : 2 * ring;
      for (std::int32_t i = -ring; i <= ring; i += step) {
        const double gap_x_m = across.GapTo(i);
        if (gap_x_m * gap_x_m + gap_y_m * gap_y_m < best.squared_m2) LookInto(x + i, y + j, p, best);
      }
    }
  }
  if (best.point < 0) return nullptr;
  likely = best.point;
  return &points_[static_cast<std::size_t>(best.point)];
}

}  // namespace cairn::slam
