#include "server/slam/matchers/hough_transform.h"

#include <algorithm>
#include <cmath>

#include "common/geometry/angle.h"

namespace cairn::slam {

HoughTransform::HoughTransform(std::span<const SurfacePoint> points, int directions, double rho_step_m,
                               double max_range_m)
    : directions_(directions),
      rho_step_m_(rho_step_m),
      half_(static_cast<int>(std::ceil(max_range_m / rho_step_m)) + 1),
      votes_(static_cast<std::size_t>(directions) * static_cast<std::size_t>(2 * half_ + 1), 0.0F),
      spectrum_(static_cast<std::size_t>(directions), 0.0) {
  const auto row = static_cast<std::size_t>(2 * half_ + 1);
  for (int d = 0; d < directions_; ++d) {
    const double theta = kPi * d / directions_, c = std::cos(theta), s = std::sin(theta);
    float* const column = votes_.data() + static_cast<std::size_t>(d) * row;
    for (const SurfacePoint& point : points) {
      if (point.p.squaredNorm() > max_range_m * max_range_m) continue;
      const double bin = (c * point.p.x() + s * point.p.y()) / rho_step_m_ + half_;
      const auto low = static_cast<std::size_t>(bin);
      const auto share = static_cast<float>(bin - static_cast<double>(low));
      column[low] += 1.0F - share;
      column[low + 1] += share;
    }
    double energy = 0.0;
    for (std::size_t i = 0; i < row; ++i) energy += static_cast<double>(column[i]) * static_cast<double>(column[i]);
    spectrum_[static_cast<std::size_t>(d)] = energy;
  }
}

float HoughTransform::At(int direction, int rho_bin) const {
  int turns = direction / directions_, d = direction % directions_;
  if (d < 0) {
    d += directions_;
    --turns;
  }
  const int i = turns % 2 == 0 ? rho_bin : 2 * half_ - rho_bin;
  if (i < 0 || i > 2 * half_) return 0.0F;
  return votes_[static_cast<std::size_t>(d) * static_cast<std::size_t>(2 * half_ + 1) + static_cast<std::size_t>(i)];
}

std::vector<Peak> PeaksOf(std::span<const double> values, bool circular, int count, double least) {
  const int size = static_cast<int>(values.size());
  const auto at = [&](int i) {
    if (circular) return values[static_cast<std::size_t>((i + size) % size)];
    return i < 0 || i >= size ? 0.0 : values[static_cast<std::size_t>(i)];
  };
  std::vector<Peak> peaks;
  for (int i = 0; i < size; ++i) {
    const double left = at(i - 1), here = at(i), right = at(i + 1);
    if (here <= 0.0 || here < left || here <= right) continue;  // A plateau is represented by its right end.
    // Second difference, for a parabola through the three values.
    const double bend = left - 2.0 * here + right;
    peaks.push_back({i + (bend < 0.0 ? 0.5 * (left - right) / bend : 0.0), here});
  }
  std::stable_sort(peaks.begin(), peaks.end(), [](const Peak& a, const Peak& b) { return a.height > b.height; });
  if (static_cast<int>(peaks.size()) > count) peaks.resize(static_cast<std::size_t>(count));
  std::erase_if(peaks, [&](const Peak& peak) { return peak.height < least * peaks.front().height; });
  return peaks;
}

std::vector<double> CorrelateSpectra(const HoughTransform& ref, const HoughTransform& curr) {
  // The mean has no information about the direction.
  const auto centred = [](std::vector<double> values) {
    double mean = 0.0;
    for (const double value : values) mean += value;
    mean /= static_cast<double>(values.size());
    for (double& value : values) value -= mean;
    return values;
  };
  const std::vector<double> a = centred(ref.spectrum()), b = centred(curr.spectrum());
  const std::size_t size = a.size();
  std::vector<double> correlation(size, 0.0);
  for (std::size_t turn = 0; turn < size; ++turn) {
    for (std::size_t d = 0; d < size; ++d) correlation[turn] += a[d] * b[(d + size - turn) % size];
  }
  return correlation;
}

std::vector<double> CorrelateColumns(const HoughTransform& ref, const HoughTransform& curr, int direction, int turn,
                                     int centre, int reach) {
  const int size = 2 * ref.half() + 1;
  std::vector<float> reference(static_cast<std::size_t>(size));
  for (int i = 0; i < size; ++i) reference[static_cast<std::size_t>(i)] = ref.At(direction, i);
  std::vector<double> correlation(static_cast<std::size_t>(2 * reach + 1), 0.0);
  for (int i = 0; i < size; ++i) {
    const auto votes = static_cast<double>(curr.At(direction - turn, i));
    if (votes <= 0.0) continue;
    for (int k = -reach; k <= reach; ++k) {
      const int j = i + centre + k;
      if (j >= 0 && j < size)
        correlation[static_cast<std::size_t>(k + reach)] +=
            votes * static_cast<double>(reference[static_cast<std::size_t>(j)]);
    }
  }
  return correlation;
}

}  // namespace cairn::slam
