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

std::int32_t CellOf(double coordinate_m) {
  const double cells = coordinate_m / kCellM;
  const auto towards_zero = static_cast<std::int32_t>(cells);  // Without the call that std::floor is.
  return towards_zero - (cells < towards_zero ? 1 : 0);
}

// The quarter of a cell at this distance from the cell's lower left corner.
std::size_t QuarterAt(double x_m, double y_m) {
  return (x_m < 0.5 * kCellM ? 0U : 1U) + (y_m < 0.5 * kCellM ? 0U : 2U);
}

// Where a place lies in its cell, along one axis: how far the cells `offset` cells away are at least, and the halves of
// cells so many halves away from the lower half of this cell.
struct Borders {
  explicit Borders(double low) : low_m(low) {}
  [[nodiscard]] double nearest_m() const { return std::min(low_m, kCellM - low_m); }
  [[nodiscard]] double GapTo(std::int32_t offset) const { return Gap(offset * kCellM, kCellM); }
  [[nodiscard]] double GapToHalf(std::int32_t halves) const { return Gap(halves * (0.5 * kCellM), 0.5 * kCellM); }
  [[nodiscard]] double Gap(double begin_m, double side_m) const {
    // Rounding must not exclude a cell that holds a point just as near as the bound.
    constexpr double kRoundingM = 1e-7;
    return std::max(0.0, std::max(begin_m - low_m, low_m - (begin_m + side_m)) - kRoundingM);
  }
  double low_m;
};

// REQUIRES: the value is finite and not negative.
double NextLarger(double value) {
  return std::bit_cast<double>(std::bit_cast<std::uint64_t>(value) + 1);
}

}  // namespace

struct PointIndex::Place {
  explicit Place(const Eigen::Vector2d& at)
      : p(at),
        x(CellOf(at.x())),
        y(CellOf(at.y())),
        across(at.x() - x * kCellM),
        along(at.y() - y * kCellM) {}
  const Eigen::Vector2d& p;
  std::int32_t x, y;  // Its cell.
  Borders across, along;
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
  while (table_[slot].used && (table_[slot].x != x || table_[slot].y != y)) slot = (slot + 1) & mask;
  return slot;
}

void PointIndex::Grow() {
  const std::vector<Cell> old = std::exchange(table_, std::vector<Cell>(2 * table_.size()));
  for (const Cell& cell : old)
    if (cell.used) table_[SlotOf(cell.x, cell.y)] = cell;
}

void PointIndex::Add(const SurfacePoint& point) {
  if (2 * cells_ >= table_.size()) Grow();
  const Place place(point.p);
  Cell& cell = table_[SlotOf(place.x, place.y)];
  if (!cell.used) {
    cell.x = place.x, cell.y = place.y;
    cell.used = true;
    ++cells_;
    empty_rings_.Fill(place.x, place.y);
  }
  std::int32_t& newest = cell.newest[QuarterAt(place.across.low_m, place.along.low_m)];
  if (newest == kNone || blocks_[static_cast<std::size_t>(newest)].size == Block::kPoints) {
    blocks_.emplace_back().older = newest;
    newest = static_cast<std::int32_t>(blocks_.size()) - 1;
  }
  Block& block = blocks_[static_cast<std::size_t>(newest)];
  const auto at = static_cast<std::size_t>(block.size++);
  block.x[at] = static_cast<float>(place.across.low_m);
  block.y[at] = static_cast<float>(place.along.low_m);
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

// Distances within a search are a few metres at most, where those in single precision are exact to a micrometre.
void PointIndex::Best::Set(double squared, std::int32_t at) {
  constexpr double kRoundingM = 2e-6;
  squared_m2 = squared;
  point = at;
  const double reach_m = std::sqrt(squared) * (1.0 + 1e-6) + kRoundingM;
  may_be_nearer_m2 = static_cast<float>(reach_m * reach_m * (1.0 + 1e-6));
}

// Looks into the cell that is (i, j) cells away from that of the place.
void PointIndex::LookInto(const Place& place, std::int32_t i, std::int32_t j, Best& best) const {
  const Cell& cell = table_[SlotOf(place.x + i, place.y + j)];
  if (!cell.used) return;
  const std::int32_t before = best.point;
  // In its own cell the quarter of the place is the first, because the others seldom hold a nearer point.
  const std::size_t first = i == 0 && j == 0 ? QuarterAt(place.across.low_m, place.along.low_m) : 0;
  for (std::size_t k = 0; k < cell.newest.size(); ++k) {
    const std::size_t quarter = k ^ first;
    if (cell.newest[quarter] == kNone) continue;
    const double gap_x_m = place.across.GapToHalf(2 * i + static_cast<std::int32_t>(quarter & 1U)),
                 gap_y_m = place.along.GapToHalf(2 * j + static_cast<std::int32_t>(quarter >> 1U));
    if (gap_x_m * gap_x_m + gap_y_m * gap_y_m < best.squared_m2)
      Compare(place, i, j, cell.newest[quarter], before, best);
  }
}

// Compares the points of one quarter. `before` is the best point before the search looked into this cell.
void PointIndex::Compare(const Place& place, std::int32_t i, std::int32_t j, std::int32_t newest, std::int32_t before,
                         Best& best) const {
  const auto dropped = static_cast<std::int32_t>(dropped_);
  const auto p_x = static_cast<float>(place.across.low_m - i * kCellM),
             p_y = static_cast<float>(place.along.low_m - j * kCellM);
  std::int32_t left = kMaxInQuarter;
  for (std::int32_t b = newest; b != kNone && left > 0;) {
    const Block& block = blocks_[static_cast<std::size_t>(b)];
    if (block.point[static_cast<std::size_t>(block.size) - 1] < dropped) return;
    std::array<std::int32_t, Block::kPoints> candidate;
    std::int32_t candidates = 0;
    for (std::size_t n = 0; n < candidate.size(); ++n) {
      const float dx = block.x[n] - p_x, dy = block.y[n] - p_y;
      candidate[n] = dx * dx + dy * dy <= best.may_be_nearer_m2 ? 1 : 0;
      candidates |= candidate[n];
    }
    if (candidates != 0) {
      const auto end = static_cast<std::size_t>(std::max(0, block.size - left));
      for (auto n = static_cast<std::size_t>(block.size); n-- > end;) {
        const std::int32_t at = block.point[n];
        if (candidate[n] == 0 || at < dropped) continue;
        const double squared_m2 = (points_[static_cast<std::size_t>(at)].p - place.p).squaredNorm();
        const bool as_near = squared_m2 == best.squared_m2 && best.point != before && at > best.point;
        if (squared_m2 < best.squared_m2 || as_near) best.Set(squared_m2, at);
      }
    }
    left -= block.size;
    b = block.older;
  }
}

const SurfacePoint* PointIndex::Nearest(const Eigen::Vector2d& p, double max_distance_m, std::int32_t& likely) const {
  if (points_.empty()) return nullptr;
  Best best(max_distance_m * max_distance_m);
  if (likely != kNone) {
    // The likely point itself has to be nearer than the bound: it may be the nearest.
    const double bound_m2 = NextLarger((points_[static_cast<std::size_t>(likely)].p - p).squaredNorm());
    if (bound_m2 < best.squared_m2) best.Set(bound_m2, kNone);
  }
  const Place place(p);
  const double border_m = std::min(place.across.nearest_m(), place.along.nearest_m());
  const std::int32_t empty = empty_rings_.Around(place.x, place.y);
  if (empty == 0) LookInto(place, 0, 0, best);
  for (std::int32_t ring = std::max(1, empty);; ++ring) {
    const double least_m = std::max(0.0, (ring - 1) * kCellM + border_m - 1e-7);
    if (least_m * least_m >= best.squared_m2) break;
    for (std::int32_t j = -ring; j <= ring; ++j) {
      const double gap_y_m = place.along.GapTo(j);
      const std::int32_t step = std::abs(j) == ring ? 1 : 2 * ring;
      for (std::int32_t i = -ring; i <= ring; i += step) {
        const double gap_x_m = place.across.GapTo(i);
        if (gap_x_m * gap_x_m + gap_y_m * gap_y_m < best.squared_m2) LookInto(place, i, j, best);
      }
    }
  }
  if (best.point == kNone) return nullptr;
  likely = best.point;
  return &points_[static_cast<std::size_t>(best.point)];
}

}  // namespace cairn::slam
