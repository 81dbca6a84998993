#include "server/slam/loops/likelihood_pyramid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

// Replaces every value by the larger of itself and the value `ahead` elements later. Written so that
// compilers vectorise it.
void MaxAhead(const std::uint8_t* from, std::uint8_t* to, std::size_t count, std::size_t ahead) {
  const std::size_t paired = count > ahead ? count - ahead : 0;
  for (std::size_t i = 0; i < paired; ++i) to[i] = std::max(from[i], from[i + ahead]);
  for (std::size_t i = paired; i < count; ++i) to[i] = from[i];
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
}

}  // namespace cairn::slam
