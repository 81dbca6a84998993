#include "server/slam/matchers/likelihood_table.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

// Longest distance between neighbouring hits of one straight wall (m): the surface between them is drawn as
// well.
constexpr double kLongestStroke = 1.0;
bool OneSurface(const SurfacePoint& a, const SurfacePoint& b) {
  if (!a.smooth() || !b.smooth() || a.normal.dot(b.normal) < 0.9) return false;
  const Eigen::Vector2d between = b.p - a.p;
  const double length = between.norm();
  return length < kLongestStroke && std::abs(a.normal.dot(between)) < 0.1 * length + 0.02 &&
         std::abs(b.normal.dot(between)) < 0.1 * length + 0.02;
}

// Replaces each value by the maximum of the `block` values that begin at it, along one line of a raster with
// the given stride.
void SlideMaximum(std::uint8_t* values, int count, std::ptrdiff_t stride, int block) {
  // By doubling: after a step of s, each value is the maximum of the 2 s values that begin at it. At the end
  // of the line there are fewer.
  int have = 1;
  while (have < block) {
    const int step = std::min(have, block - have);
    for (int i = 0; i + step < count; ++i)
      values[i * stride] = std::max(values[i * stride], values[(i + step) * stride]);
    have += step;
  }
}

}  // namespace

LikelihoodTable::LikelihoodTable(std::span<const SurfacePoint> points, double cell_m, double reach_m,
                                 double max_range_m, double margin_m, int block)
    : cell_m_(cell_m) {
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Zero();
  const auto near = [&](const SurfacePoint& point) { return point.p.squaredNorm() <= max_range_m * max_range_m; };
  for (const SurfacePoint& point : points) {
    if (!near(point)) continue;
    low = low.cwiseMin(point.p);
    high = high.cwiseMax(point.p);
  }
  const int radius = static_cast<int>(std::ceil(reach_m / cell_m));
  const double border = margin_m + (radius + block + 1) * cell_m;
  origin_ = low - Eigen::Vector2d::Constant(border);
  columns_ = static_cast<int>(std::ceil((high.x() - low.x() + 2 * border) / cell_m)) + 1;
  rows_ = static_cast<int>(std::ceil((high.y() - low.y() + 2 * border) / cell_m)) + 1;
  fine_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 0);

  const int side = 2 * radius + 1;
  std::vector<std::uint8_t> kernel(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
  for (int y = -radius; y <= radius; ++y) {
    for (int x = -radius; x <= radius; ++x) {
      const double share = (x * x + y * y) * cell_m * cell_m / (reach_m * reach_m);
      kernel[static_cast<std::size_t>((y + radius) * side + x + radius)] =
          static_cast<std::uint8_t>(std::lround(255.0 * std::max(0.0, 1.0 - share)));
    }
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!near(points[i])) continue;
    Stamp(points[i].p, kernel, radius);
    if (i + 1 == points.size() || !near(points[i + 1]) || !OneSurface(points[i], points[i + 1])) continue;
    const Eigen::Vector2d between = points[i + 1].p - points[i].p;
    const int steps = static_cast<int>(between.norm() / cell_m);
    for (int s = 1; s < steps; ++s) Stamp(points[i].p + s * between / steps, kernel, radius);
  }

  coarse_ = fine_;
  for (int y = 0; y < rows_; ++y)
    SlideMaximum(coarse_.data() + static_cast<std::ptrdiff_t>(y) * columns_, columns_, 1, block);
  // The same doubling along the columns, for whole rows at a time.
  for (int have = 1; have < block;) {
    const int step = std::min(have, block - have);
    for (int y = 0; y + step < rows_; ++y) {
      std::uint8_t* const row = coarse_.data() + static_cast<std::ptrdiff_t>(y) * columns_;
      const std::uint8_t* const below = row + static_cast<std::ptrdiff_t>(step) * columns_;
      for (int x = 0; x < columns_; ++x) row[x] = std::max(row[x], below[x]);
    }
    have += step;
  }
}

void LikelihoodTable::Stamp(const Eigen::Vector2d& p, const std::vector<std::uint8_t>& kernel, int radius) {
  const Eigen::Vector2i cell = CellOf(p);
  const int side = 2 * radius + 1;
  for (int y = 0; y < side; ++y) {
    std::uint8_t* const row =
        fine_.data() + static_cast<std::ptrdiff_t>(cell.y() - radius + y) * columns_ + cell.x() - radius;
    const std::uint8_t* const stamp = kernel.data() + static_cast<std::ptrdiff_t>(y) * side;
    for (int x = 0; x < side; ++x) row[x] = std::max(row[x], stamp[x]);
  }
}

}  // namespace cairn::slam
