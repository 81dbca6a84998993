#include "server/slam/matching/point_index.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>

namespace cairn::slam {
namespace {

// With smaller cells a search compares fewer points where a wall is near, and looks into more cells where there is
// none.
constexpr double kCellM = 0.125;
constexpr std::size_t kFirstSlots = 1024;
// Rounding must not exclude a cell that holds a point just as near as the bound.
constexpr double kRoundingM = 1e-7;

std::int32_t CellOf(double coordinate_m) {
  const double cells = coordinate_m / kCellM;
  const auto towards_zero = static_cast<std::int32_t>(cells);  // Without the call that std::floor is.
  return towards_zero - (cells < towards_zero ? 1 : 0);
}

// REQUIRES: the value is finite and not negative.
double NextLarger(double value) {
  return std::bit_cast<double>(std::bit_cast<std::uint64_t>(value) + 1);
}

}  // namespace

// Where a place lies in its cell, along one axis.
struct PointIndex::Borders {
  Borders(double low, double reach_m)
      : low_m(low), first(CellOf(low - reach_m - kRoundingM)), last(CellOf(low + reach_m + kRoundingM)) {}
  [[nodiscard]] double nearest_m() const { return std::min(low_m, kCellM - low_m); }
  // How far the cells `offset` cells away are at least.
  [[nodiscard]] double GapTo(std::int32_t offset) const {
    if (offset == 0) return 0.0;
    return std::max(0.0, (offset < 0 ? low_m - (offset + 1) * kCellM : offset * kCellM - low_m) - kRoundingM);
  }
  double low_m;
  std::int32_t first, last;  // The offsets of the cells within reach.
};

// A search so far.
struct PointIndex::Search {
  Search(const Eigen::Vector2d& at, double squared)
      : p(at), x(CellOf(at.x())), y(CellOf(at.y())), low_x_m(at.x() - x * kCellM), low_y_m(at.y() - y * kCellM) {
    Set(squared, kNone);
  }
  // From now on only points count that are nearer than this.
  void Set(double squared, std::int32_t at) {
    squared_m2 = squared;
    point = at;
    const double distance_m = std::sqrt(squared), reach_m = distance_m + kClearM;
    reach_m2 = reach_m * reach_m;
    const double single_m = distance_m * (1.0 + 1e-6) + kSingleM;
    may_be_nearer_m2 = static_cast<float>(single_m * single_m * (1.0 + 1e-6));
  }
  // No point but the one that was found is nearer. REQUIRES: all cells within reach were looked into.
  [[nodiscard]] double ClearM() const {
    float next_m2 = kFarM;
    bool skipped = false;  // The nearest point is one of those that were compared, and the first of `nearest`.
    for (int i = 0; i < 4; ++i) {
      next_m2 = std::min(next_m2, next[i]);
      const bool is_found = !skipped && point != kNone && nearest[i] <= may_be_nearer_m2;
      if (!is_found) next_m2 = std::min(next_m2, nearest[i]);
      skipped = skipped || is_found;
    }
    return std::min(std::sqrt(static_cast<double>(next_m2)) * (1.0 - 1e-6) - kSingleM, std::sqrt(reach_m2));
  }

  static constexpr double kClearM = 0.005;  // So far beyond the nearest point the search goes on.
  static constexpr double kSingleM = 2e-6;  // More than the error of a distance in single precision.
  static constexpr float kFarM = 1e30F;

  const Eigen::Vector2d& p;
  std::int32_t x, y;  // Its cell.
  double low_x_m, low_y_m;
  double squared_m2 = 0.0;
  std::int32_t point = kNone;
  double reach_m2 = 0.0;          // Cells that are not nearer are not looked into.
  float may_be_nearer_m2 = 0.0F;  // Larger than squared_m2 by more than the error of single precision.
  // Of all that was compared, in four parts: the smallest squared distance and the next one.
  FourFloats nearest = {kFarM, kFarM, kFarM, kFarM};
  FourFloats next = nearest;
};

void PointIndex::EmptyRings::Clear() {
  std::fill(rings_.begin(), rings_.end(), static_cast<std::uint8_t>(kMost));
}

// From now on the cell holds a point.
void PointIndex::EmptyRings::Fill(std::int32_t x, std::int32_t y) {
  if (rings_.empty()) rings_.assign(static_cast<std::size_t>(kSide * kSide), kMost);
  if (Around(x, y) == 0) return;  // The cell, or one that shares its number, holds a point already.
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
  while (table_[slot].newest != kNone && (table_[slot].x != x || table_[slot].y != y)) slot = (slot + 1) & mask;
  return slot;
}

void PointIndex::Grow() {
  const std::vector<Cell> old = std::exchange(table_, std::vector<Cell>(2 * table_.size()));
  for (const Cell& cell : old)
    if (cell.newest != kNone) table_[SlotOf(cell.x, cell.y)] = cell;
}

void PointIndex::Add(const SurfacePoint& point) {
  if (2 * cells_ >= table_.size()) Grow();
  const std::int32_t x = CellOf(point.p.x()), y = CellOf(point.p.y());
  Cell& cell = table_[SlotOf(x, y)];
  const bool first = cell.newest == kNone;
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
  block.x[at / 4][at % 4] = static_cast<float>(point.p.x() - x * kCellM);
  block.y[at / 4][at % 4] = static_cast<float>(point.p.y() - y * kCellM);
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

// Looks into the cell that is (i, j) cells away from that of the place.
void PointIndex::LookInto(std::int32_t i, std::int32_t j, Search& search) const {
  const auto dropped = static_cast<std::int32_t>(dropped_);
  const auto p_x = static_cast<float>(search.low_x_m - i * kCellM),
             p_y = static_cast<float>(search.low_y_m - j * kCellM);
  std::int32_t left = kMaxInCell;
  for (std::int32_t b = table_[SlotOf(search.x + i, search.y + j)].newest; b != kNone && left > 0;) {
    const Block& block = blocks_[static_cast<std::size_t>(b)];
    if (block.point[static_cast<std::size_t>(block.size) - 1] < dropped) return;
    const std::int32_t end = std::max(0, block.size - left);
    for (std::int32_t four = (block.size - 1) / 4; four >= end / 4; --four) {
      const auto f = static_cast<std::size_t>(four);
      const FourFloats dx = block.x[f] - p_x, dy = block.y[f] - p_y, squared = dx * dx + dy * dy;
      const FourFloats farther = squared > search.nearest ? squared : search.nearest;
      search.next = farther < search.next ? farther : search.next;
      search.nearest = squared < search.nearest ? squared : search.nearest;
      const auto nearer = squared <= search.may_be_nearer_m2;
      const auto halves = std::bit_cast<std::array<std::uint64_t, 2>>(nearer);
      if ((halves[0] | halves[1]) == 0) continue;
      for (std::int32_t n = std::min(4 * four + 4, block.size); n-- > std::max(4 * four, end);) {
        if (nearer[static_cast<std::size_t>(n % 4)] == 0) continue;
        const std::int32_t at = block.point[static_cast<std::size_t>(n)];
        const double squared_m2 = (points_[static_cast<std::size_t>(at)].p - search.p).squaredNorm();
        if (squared_m2 < search.squared_m2 && at >= dropped) search.Set(squared_m2, at);
      }
    }
    left -= block.size;
    b = block.older;
  }
}

void PointIndex::LookAround(Search& search) const {
  const double reach_m = std::sqrt(search.reach_m2);
  const Borders across(search.low_x_m, reach_m), along(search.low_y_m, reach_m);
  const double border_m = std::min(across.nearest_m(), along.nearest_m());
  const std::int32_t empty = empty_rings_.Around(search.x, search.y);
  const std::int32_t rings = std::max({-across.first, across.last, -along.first, along.last});
  if (empty == 0) LookInto(0, 0, search);
  for (std::int32_t ring = std::max(1, empty); ring <= rings; ++ring) {
    const double least_m = std::max(0.0, (ring - 1) * kCellM + border_m - kRoundingM);
    if (least_m * least_m >= search.reach_m2) break;
    for (std::int32_t j = std::max(-ring, along.first); j <= std::min(ring, along.last); ++j) {
      const double gap_y_m = along.GapTo(j);
      const bool edge = std::abs(j) == ring;  // All cells of the ring in this row, or the first and the last.
      const std::int32_t step = edge ? 1 : 2 * ring;
      for (std::int32_t i = edge ? std::max(-ring, across.first) : -ring; i <= std::min(ring, across.last); i += step) {
        const double gap_x_m = across.GapTo(i);
        if (gap_x_m * gap_x_m + gap_y_m * gap_y_m < search.reach_m2) LookInto(i, j, search);
      }
    }
  }
}

const SurfacePoint* PointIndex::Nearest(const Eigen::Vector2d& p, double max_distance_m, Found& last) const {
  if (points_.empty()) return nullptr;
  const double most_m2 = max_distance_m * max_distance_m;
  const auto answer = [&](double squared_m2) {
    return squared_m2 < most_m2 ? &points_[static_cast<std::size_t>(last.point)] : nullptr;
  };
  // The search goes a little farther than it has to, so that a place without a point has no need of another search
  // when it moves a little.
  double bound_m2 = (max_distance_m + Search::kClearM) * (max_distance_m + Search::kClearM);
  const double clear_m = last.clear_m > 0.0 ? last.clear_m - (p - last.at).norm() - kRoundingM : 0.0;
  if (last.point != kNone) {
    const double squared_m2 = (points_[static_cast<std::size_t>(last.point)].p - p).squaredNorm();
    if (clear_m > 0.0 && squared_m2 < clear_m * clear_m) return answer(squared_m2);
    // The point itself has to be nearer than the bound: it may be the nearest.
    bound_m2 = std::min(bound_m2, NextLarger(squared_m2));
  } else if (clear_m >= max_distance_m) {
    return nullptr;
  }
  Search search(p, bound_m2);
  LookAround(search);
  last = {search.point, p, search.ClearM()};
  return last.point == kNone ? nullptr : answer(search.squared_m2);
}

}  // namespace cairn::slam
