#include "server/slam/loops/region_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/geometry/transform2.h"

namespace cairn::slam {
namespace {

// Replaces every value by the larger of itself and the value `ahead` elements later. Written so that
// compilers vectorise it.
void MaxAhead(const std::uint8_t* from, std::uint8_t* to, std::size_t count, std::size_t ahead) {
  const std::size_t paired = count > ahead ? count - ahead : 0;
  for (std::size_t i = 0; i < paired; ++i) to[i] = std::max(from[i], from[i + ahead]);
  for (std::size_t i = paired; i < count; ++i) to[i] = from[i];
}

// At this distance one angle step moves a point by one cell. Farther points move by more, which the reach of
// the likelihood tolerates.
constexpr double kFullDetailM = 15.0;

// The points in another order, in which each part of them is spread over all.
std::vector<Eigen::Vector2d> Spread(std::span<const Eigen::Vector2d> points) {
  std::vector<Eigen::Vector2d> spread;
  spread.reserve(points.size());
  for (std::size_t first = 0; first < LikelihoodPyramid::kParts; ++first)
    for (std::size_t i = first; i < points.size(); i += LikelihoodPyramid::kParts) spread.push_back(points[i]);
  return spread;
}

// Most blocks of the coarsest level whose bounds are kept: 1 MiB.
constexpr std::size_t kMostKept = 1 << 18;

// The first cell of a part.
std::size_t BeginOf(std::size_t part, const LikelihoodPyramid::Pattern& pattern) {
  return part * pattern.cells.size() / LikelihoodPyramid::kParts;
}

}  // namespace

LikelihoodPyramid::LikelihoodPyramid(std::span<const SurfacePoint> reference, double cell_m, double reach_m, int levels)
    : cell_m_(cell_m) {
  int high_x = std::numeric_limits<int>::min(), high_y = high_x;
  low_x_ = low_y_ = std::numeric_limits<int>::max();
  const auto cell_of = [&](double v) { return static_cast<int>(std::floor(v / cell_m)); };
  for (const SurfacePoint& point : reference) {
    const int x = cell_of(point.p.x()), y = cell_of(point.p.y());
    low_x_ = std::min(low_x_, x), high_x = std::max(high_x, x);
    low_y_ = std::min(low_y_, y), high_y = std::max(high_y, y);
  }
  if (reference.empty()) low_x_ = low_y_ = high_x = high_y = 0;
  const int reach = static_cast<int>(std::ceil(reach_m / cell_m));
  width_ = high_x - low_x_ + 1 + kPad + reach + 1;
  height_ = high_y - low_y_ + 1 + kPad + reach + 1;
  const auto size = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);

  std::vector<std::uint8_t> stamp(static_cast<std::size_t>((2 * reach + 1) * (2 * reach + 1)));
  for (int dy = -reach; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      const double share = 1.0 - std::hypot(dx, dy) * cell_m / reach_m;
      stamp[static_cast<std::size_t>((dy + reach) * (2 * reach + 1) + dx + reach)] =
          static_cast<std::uint8_t>(std::lround(255.0 * std::max(0.0, share)));
    }
  }
  levels_.emplace_back(size, 0);
  std::vector<std::uint8_t>& finest = levels_.front();
  for (const SurfacePoint& point : reference) {
    const int column = cell_of(point.p.x()) + kPad - low_x_, row = cell_of(point.p.y()) + kPad - low_y_;
    if (finest[static_cast<std::size_t>(row * width_ + column)] == 255) continue;
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        std::uint8_t& cell = finest[static_cast<std::size_t>((row + dy) * width_ + column + dx)];
        cell = std::max(cell, stamp[static_cast<std::size_t>((dy + reach) * (2 * reach + 1) + dx + reach)]);
      }
    }
  }
  std::vector<std::uint8_t> along(size);
  const auto width = static_cast<std::size_t>(width_);
  for (int level = 1; level < levels; ++level) {
    const std::size_t half = std::size_t{1} << (level - 1);
    for (std::size_t row = 0; row < size; row += width)
      MaxAhead(levels_.back().data() + row, along.data() + row, width, half);
    levels_.emplace_back(size);
    MaxAhead(along.data(), levels_.back().data(), size, half * width);  // All rows are processed at once.
  }
  const std::size_t side = std::size_t{1} << (levels - 1);
  blocks_in_row_ = (width + side - 1) / side;
  by_phase_.assign(static_cast<std::size_t>(height_) * side * blocks_in_row_, 0);
  for (std::size_t row = 0; row < static_cast<std::size_t>(height_); ++row)
    for (std::size_t column = 0; column < width; ++column)
      by_phase_[(row * side + column % side) * blocks_in_row_ + column / side] = levels_.back()[row * width + column];
}

void LikelihoodPyramid::SumsOfRow(std::span<const Cell> cells, int x, int y, std::span<std::int64_t> sums) const {
  constexpr std::size_t kAtOnce = 257;  // The sum of so many values of at most 255 fits into 16 bits.
  const int shift = levels() - 1, side = 1 << shift;
  const int to_column = x + kPad - low_x_, to_row = y + kPad - low_y_;
  std::ranges::fill(sums, 0);
  std::vector<std::uint16_t> part(sums.size());
  for (std::size_t first = 0; first < cells.size(); first += kAtOnce) {
    std::ranges::fill(part, std::uint16_t{0});
    for (const Cell& cell : cells.subspan(first, std::min(kAtOnce, cells.size() - first))) {
      const int column = cell.x + to_column, row = cell.y + to_row;
      if (row < 0 || row >= height_) continue;
      // Rounded down also where the column is negative.
      const std::ptrdiff_t block = column >> shift;
      const auto begin = std::max<std::ptrdiff_t>(0, -block);
      const auto end = std::min(std::ssize(part), static_cast<std::ptrdiff_t>(blocks_in_row_) - block);
      const std::size_t phase = static_cast<std::size_t>(row) * static_cast<std::size_t>(side) +
                                static_cast<std::size_t>(column & (side - 1));
      const std::uint8_t* values = by_phase_.data() + phase * blocks_in_row_;
      std::uint16_t* to = part.data();
      for (std::ptrdiff_t i = begin; i < end; ++i) to[i] = static_cast<std::uint16_t>(to[i] + values[block + i]);
    }
    for (std::size_t i = 0; i < part.size(); ++i) sums[i] += part[i];
  }
}

LikelihoodPyramid::Pattern LikelihoodPyramid::PatternOf(std::vector<Cell> cells) const {
  Pattern pattern{std::move(cells), {}, {}, {}};
  if (!pattern.cells.empty()) pattern.low = pattern.high = pattern.cells.front();
  for (const Cell& cell : pattern.cells) {
    pattern.low = {std::min(pattern.low.x, cell.x), std::min(pattern.low.y, cell.y)};
    pattern.high = {std::max(pattern.high.x, cell.x), std::max(pattern.high.y, cell.y)};
  }
  // From the lowest cell: far from the origin of the map, products of the cells themselves would overflow.
  pattern.offsets.reserve(pattern.cells.size());
  for (const Cell& cell : pattern.cells)
    pattern.offsets.push_back(std::ptrdiff_t{cell.y - pattern.low.y} * width_ + (cell.x - pattern.low.x));
  return pattern;
}

LikelihoodPyramid::SumsFrom LikelihoodPyramid::MostOf(const Pattern& pattern) {
  SumsFrom most{};
  for (std::size_t part = 0; part < kParts; ++part)
    most[part] = 255 * static_cast<std::int32_t>(pattern.cells.size() - BeginOf(part, pattern));
  return most;
}

LikelihoodPyramid::SumsFrom LikelihoodPyramid::SumsOfBest(int level, const Pattern& pattern, int x, int y,
                                                          std::int32_t enough, const SumsFrom& at_most) const {
  const std::uint8_t* raster = levels_[static_cast<std::size_t>(level)].data();
  const int to_column = x + kPad - low_x_, to_row = y + kPad - low_y_;
  const auto width = static_cast<std::uint32_t>(width_), height = static_cast<std::uint32_t>(height_);
  const bool inside = pattern.low.x + to_column >= 0 && pattern.high.x + to_column < width_ &&
                      pattern.low.y + to_row >= 0 && pattern.high.y + to_row < height_;
  const std::ptrdiff_t lowest = std::ptrdiff_t{pattern.low.y + to_row} * width_ + (pattern.low.x + to_column);
  SumsFrom sums{};
  std::int32_t sum = 0;
  for (std::size_t part = 0; part < kParts; ++part) {
    if (sum + at_most[part] <= enough) return {sum};
    std::int32_t of_part = 0;
    const std::size_t end = BeginOf(part + 1, pattern);
    if (inside) {
      for (std::size_t i = BeginOf(part, pattern); i < end; ++i) of_part += raster[lowest + pattern.offsets[i]];
    } else {
      for (std::size_t i = BeginOf(part, pattern); i < end; ++i) {
        // As unsigned numbers, cells to the left and below are too large as well.
        const auto column = static_cast<std::uint32_t>(pattern.cells[i].x + to_column),
                   row = static_cast<std::uint32_t>(pattern.cells[i].y + to_row);
        if (column < width && row < height) of_part += raster[static_cast<std::size_t>(row) * width + column];
      }
    }
    sums[part] = of_part;
    sum += of_part;
  }
  for (std::size_t part = kParts; part-- > 0;) sums[part] += sums[part + 1];
  return sums;
}

PoseSearch::PoseSearch(std::span<const Eigen::Vector2d> points_curr, const LikelihoodPyramid& pyramid,
                       const SearchWindow& window)
    : pyramid_(&pyramid), window_(window), full_(255.0 * static_cast<double>(points_curr.size())) {
  double farthest = 1.0;
  for (const Eigen::Vector2d& p : points_curr) farthest = std::max(farthest, p.norm());
  step_rad_ = pyramid.cell_m() / std::min(farthest, kFullDetailM);
  reach_turns_ = std::max(1, static_cast<int>(std::ceil(window.reach_rad / step_rad_)));
  reach_cells_ = static_cast<int>(std::ceil(window.reach_m / pyramid.cell_m()));
  const std::vector<Eigen::Vector2d> points = Spread(points_curr);
  for (int turn = -reach_turns_; turn <= reach_turns_; ++turn) {
    const Pose2& centre = window.T_ref_curr_centre;
    const Transform2 pose({centre.x, centre.y, WrapAngle(centre.theta + turn * step_rad_)});
    std::vector<LikelihoodPyramid::Cell> cells;
    cells.reserve(points.size());
    for (const Eigen::Vector2d& p : points) {
      const Eigen::Vector2d p_ref = pose * p;
      cells.push_back({static_cast<int>(std::floor(p_ref.x() / pyramid.cell_m())),
                       static_cast<int>(std::floor(p_ref.y() / pyramid.cell_m()))});
    }
    turned_.push_back(pyramid.PatternOf(std::move(cells)));
  }
}

void PoseSearch::Begin(double min_score, std::span<const Exclusion> exclusions, bool any) {
  exclusions_.assign(exclusions.begin(), exclusions.end());
  any_ = any;
  looked_at_coarsest_ = false;
  next_row_ = 0;
  left_.clear();
  best_ = {};
  best_.sums.front() = static_cast<std::int32_t>(min_score * full_);
  found_ = false;
  scored_ = 0;
}

bool PoseSearch::GoOn(int blocks) {
  const int end = blocks < kMaxBlocks - scored_ ? scored_ + blocks : kMaxBlocks;
  if (!looked_at_coarsest_) looked_at_coarsest_ = LookOnAtCoarsest(end);
  if (!looked_at_coarsest_) return false;
  // Depth first, in the order of the bounds; skips blocks that cannot exceed the best score.
  while (!left_.empty() && scored_ <= kMaxBlocks && !(any_ && found_)) {
    if (scored_ > end) return false;
    const Block block = left_.back();
    left_.pop_back();
    if (block.bound() <= best_.bound()) continue;
    if (block.level > 0) {
      Divide(block);
    } else {
      best_ = block;
      found_ = true;
    }
  }
  return true;
}

std::optional<RegionPeak> PoseSearch::peak() const {
  const bool complete = scored_ <= kMaxBlocks;
  if (!found_ && complete) return std::nullopt;
  return RegionPeak{PoseOf(best_), best_.bound() / full_, complete};
}

// Looks at the blocks of the coarsest level, row by row, until about `end` blocks are evaluated. Returns whether it has
// looked at all.
bool PoseSearch::LookOnAtCoarsest(int end) {
  const int level = pyramid_->levels() - 1, side = 1 << level;
  const auto in_row = static_cast<std::size_t>(2 * reach_cells_ / side + 1);  // And so many rows for each heading.
  const std::size_t rows = turned_.size() * in_row;
  std::vector<std::int64_t> bounds(in_row);
  for (; next_row_ < rows && scored_ <= kMaxBlocks; ++next_row_) {
    if (scored_ > end) return false;
    scored_ += static_cast<int>(in_row);
    const auto turn = static_cast<int>(next_row_ / in_row);
    const int y = -reach_cells_ + side * static_cast<int>(next_row_ % in_row);
    const Pattern& pattern = turned_[static_cast<std::size_t>(turn)];
    if (const std::size_t known = next_row_ * in_row; known < coarsest_.size()) {
      std::copy_n(coarsest_.begin() + static_cast<std::ptrdiff_t>(known), in_row, bounds.begin());
    } else {
      pyramid_->SumsOfRow(pattern.cells, -reach_cells_, y, bounds);
      if (rows * in_row <= kMostKept)
        for (const std::int64_t bound : bounds) coarsest_.push_back(static_cast<std::int32_t>(bound));
    }
    int x = -reach_cells_;
    for (const std::int64_t bound : bounds) {
      Block block{turn, x, y, level, {}};
      x += side;
      if (bound <= best_.bound()) continue;
      block.sums = LikelihoodPyramid::MostOf(pattern);
      block.sums.front() = static_cast<std::int32_t>(bound);
      if (!Excluded(block)) left_.push_back(block);
    }
  }
  // Of equal ones the first is the next.
  std::ranges::reverse(left_);
  std::ranges::stable_sort(left_, {}, &Block::bound);
  return true;
}

// Puts those of the four quarters of the block that may hold a better pose before all that are left.
void PoseSearch::Divide(const Block& block) {
  const int level = block.level - 1, half = 1 << level;
  const auto first = std::ssize(left_);
  for (const int dy : {0, half}) {
    for (const int dx : {0, half}) {
      Block part{block.turn, block.x + dx, block.y + dy, level, {}};
      if (part.x > reach_cells_ || part.y > reach_cells_ || Excluded(part)) continue;
      if (++scored_ > kMaxBlocks) return;
      part.sums = pyramid_->SumsOfBest(level, PatternOf(part), part.x, part.y, best_.bound(), block.sums);
      if (part.bound() <= best_.bound()) continue;
      auto at = left_.end();
      while (at - left_.begin() > first && (at - 1)->bound() >= part.bound()) --at;
      left_.insert(at, part);
    }
  }
}

Pose2 PoseSearch::PoseOf(const Block& block) const {
  const Pose2& centre = window_.T_ref_curr_centre;
  return {centre.x + block.x * pyramid_->cell_m(), centre.y + block.y * pyramid_->cell_m(),
          WrapAngle(centre.theta + (block.turn - reach_turns_) * step_rad_)};
}

bool PoseSearch::Excluded(const Block& block) const {
  if (exclusions_.empty()) return false;
  const Pose2 low = PoseOf(block);
  // The whole block must lie inside, so its farthest corner is checked.
  const double side = ((1 << block.level) - 1) * pyramid_->cell_m();
  return std::any_of(exclusions_.begin(), exclusions_.end(), [&](const Exclusion& one) {
    if (std::abs(AngleDiff(low.theta, one.T_ref_curr.theta)) > one.radius_rad) return false;
    const double dx = std::max(std::abs(low.x - one.T_ref_curr.x), std::abs(low.x + side - one.T_ref_curr.x));
    const double dy = std::max(std::abs(low.y - one.T_ref_curr.y), std::abs(low.y + side - one.T_ref_curr.y));
    return std::hypot(dx, dy) <= one.radius_m;
  });
}

std::optional<RegionPeak> FindBestPose(std::span<const Eigen::Vector2d> points_curr, const LikelihoodPyramid& pyramid,
                                       const SearchWindow& window, double min_score,
                                       const std::optional<Exclusion>& exclusion) {
  if (!exclusion) return FindBestPose(points_curr, pyramid, window, min_score, std::span<const Exclusion>());
  return FindBestPose(points_curr, pyramid, window, min_score, std::span(&*exclusion, 1));
}

std::optional<RegionPeak> FindBestPose(std::span<const Eigen::Vector2d> points_curr, const LikelihoodPyramid& pyramid,
                                       const SearchWindow& window, double min_score,
                                       std::span<const Exclusion> exclusions) {
  if (points_curr.empty()) return std::nullopt;
  PoseSearch search(points_curr, pyramid, window);
  search.Begin(min_score, exclusions);
  search.GoOn(kMaxBlocks);
  return search.peak();
}

}  // namespace cairn::slam
