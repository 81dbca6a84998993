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

// A square block of translations at one heading, with an upper bound of their scores.
struct Block {
  int turn = 0;  // Index of the heading.
  int x = 0;     // Lowest translation, in cells.
  int y = 0;
  std::int64_t bound = 0;  // Upper bound of the sum over the points.
};

class BranchAndBound {
 public:
  BranchAndBound(std::span<const Eigen::Vector2d> points, const LikelihoodPyramid& pyramid, const SearchWindow& window,
                 std::span<const Exclusion> exclusions)
      : pyramid_(pyramid), window_(window), exclusions_(exclusions) {
    double farthest = 1.0;
    for (const Eigen::Vector2d& p : points) farthest = std::max(farthest, p.norm());
    step_rad_ = pyramid.cell_m() / std::min(farthest, kFullDetailM);
    reach_turns_ = std::max(1, static_cast<int>(std::ceil(window.reach_rad / step_rad_)));
    reach_cells_ = static_cast<int>(std::ceil(window.reach_m / pyramid.cell_m()));
    for (int turn = -reach_turns_; turn <= reach_turns_; ++turn) {
      const Pose2& centre = window.T_ref_curr_centre;
      const Transform2 pose({centre.x, centre.y, WrapAngle(centre.theta + turn * step_rad_)});
      std::vector<LikelihoodPyramid::Cell>& cells = turned_.emplace_back();
      cells.reserve(points.size());
      for (const Eigen::Vector2d& p : points) {
        const Eigen::Vector2d p_ref = pose * p;
        cells.push_back({static_cast<int>(std::floor(p_ref.x() / pyramid.cell_m())),
                         static_cast<int>(std::floor(p_ref.y() / pyramid.cell_m()))});
      }
    }
  }

  std::optional<RegionPeak> Run(double min_score) {
    const double full = 255.0 * static_cast<double>(turned_.front().size());
    best_.bound = static_cast<std::int64_t>(min_score * full);
    std::vector<Block> top;
    const int level = pyramid_.levels() - 1;
    const int side = 1 << level;
    std::vector<std::int64_t> bounds(static_cast<std::size_t>(2 * reach_cells_ / side + 1));  // Those of a row.
    for (int turn = 0; turn < static_cast<int>(turned_.size()) && scored_ <= kMaxBlocks; ++turn) {
      for (int y = -reach_cells_; y <= reach_cells_ && scored_ <= kMaxBlocks; y += side) {
        scored_ += static_cast<int>(bounds.size());
        pyramid_.SumsOfRow(turned_[static_cast<std::size_t>(turn)], -reach_cells_, y, bounds);
        int x = -reach_cells_;
        for (const std::int64_t bound : bounds) {
          if (bound > best_.bound) top.push_back({turn, x, y, bound});
          x += side;
        }
      }
    }
    if (scored_ <= kMaxBlocks) {
      std::erase_if(top, [&](const Block& block) { return Excluded(block, level); });
      Search(std::move(top), level);
    }
    const bool complete = scored_ <= kMaxBlocks;
    if (!found_ && complete) return std::nullopt;
    return RegionPeak{PoseOf(best_), static_cast<double>(best_.bound) / full, complete};
  }

 private:
  [[nodiscard]] Pose2 PoseOf(const Block& block) const {
    const Pose2& centre = window_.T_ref_curr_centre;
    return {centre.x + block.x * pyramid_.cell_m(), centre.y + block.y * pyramid_.cell_m(),
            WrapAngle(centre.theta + (block.turn - reach_turns_) * step_rad_)};
  }

  [[nodiscard]] bool Excluded(const Block& block, int level) const {
    if (exclusions_.empty()) return false;
    const Pose2 low = PoseOf(block);
    // The whole block must lie inside, so its farthest corner is checked.
    const double side = ((1 << level) - 1) * pyramid_.cell_m();
    return std::any_of(exclusions_.begin(), exclusions_.end(), [&](const Exclusion& one) {
      if (std::abs(AngleDiff(low.theta, one.T_ref_curr.theta)) > one.radius_rad) return false;
      const double dx = std::max(std::abs(low.x - one.T_ref_curr.x), std::abs(low.x + side - one.T_ref_curr.x));
      const double dy = std::max(std::abs(low.y - one.T_ref_curr.y), std::abs(low.y + side - one.T_ref_curr.y));
      return std::hypot(dx, dy) <= one.radius_m;
    });
  }

  void Descend(std::vector<Block> blocks, int level) {
    std::erase_if(blocks, [&](const Block& block) { return Excluded(block, level); });
    for (Block& block : blocks) {
      if (++scored_ > kMaxBlocks) return;
      block.bound =
          pyramid_.SumOfBest(level, turned_[static_cast<std::size_t>(block.turn)], block.x, block.y, best_.bound);
    }
    Search(std::move(blocks), level);
  }

  // Depth first, in the order of the bounds; skips blocks that cannot exceed the best score.
  void Search(std::vector<Block> blocks, int level) {
    std::stable_sort(blocks.begin(), blocks.end(), [](const Block& a, const Block& b) { return a.bound > b.bound; });
    for (const Block& block : blocks) {
      if (block.bound <= best_.bound) return;
      if (level == 0) {
        best_ = block;
        found_ = true;
        return;
      }
      const int half = 1 << (level - 1);
      std::vector<Block> parts;
      for (const int dy : {0, half})
        for (const int dx : {0, half})
          if (block.x + dx <= reach_cells_ && block.y + dy <= reach_cells_)
            parts.push_back({block.turn, block.x + dx, block.y + dy, 0});
      Descend(std::move(parts), level - 1);
    }
  }

  const LikelihoodPyramid& pyramid_;
  const SearchWindow window_;
  const std::span<const Exclusion> exclusions_;
  double step_rad_ = 0.0;
  int reach_turns_ = 0;
  int reach_cells_ = 0;
  std::vector<std::vector<LikelihoodPyramid::Cell>> turned_;  // The cells of the points at each heading.
  Block best_;
  bool found_ = false;
  int scored_ = 0;
};

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

std::int64_t LikelihoodPyramid::SumOfBest(int level, std::span<const Cell> cells, int x, int y,
                                          std::int64_t enough) const {
  constexpr std::size_t kAtOnce = 32;
  const std::uint8_t* raster = levels_[static_cast<std::size_t>(level)].data();
  const int to_column = x + kPad - low_x_, to_row = y + kPad - low_y_;
  const auto width = static_cast<std::uint32_t>(width_), height = static_cast<std::uint32_t>(height_);
  std::int64_t sum = 0;
  for (std::size_t first = 0; first < cells.size(); first += kAtOnce) {
    const auto left = cells.subspan(first);
    if (sum + 255 * static_cast<std::int64_t>(left.size()) <= enough) return sum;
    for (const Cell& cell : left.first(std::min(kAtOnce, left.size()))) {
      // As unsigned numbers, cells to the left and below are too large as well.
      const auto column = static_cast<std::uint32_t>(cell.x + to_column),
                 row = static_cast<std::uint32_t>(cell.y + to_row);
      if (column < width && row < height) sum += raster[static_cast<std::size_t>(row) * width + column];
    }
  }
  return sum;
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
  return BranchAndBound(points_curr, pyramid, window, exclusions).Run(min_score);
}

}  // namespace cairn::slam
