#include "tests/studies/filters/cost.h"

#include <cmath>

#include "tests/studies/filters/corner_world.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {
namespace {

constexpr double kRingStepM = 0.25;
constexpr double kCornerApartM =
    1.5;  // Distance along the way between two pairs of corners, one on each side; similar corners are never close.
constexpr double kBesideM = 1.7;

std::vector<Corner> Ring(std::size_t count, double radius_m) {
  std::vector<Corner> corners;
  for (std::size_t i = 0; i < count; ++i) {
    const bool inside = i % 2 == 0;
    const double around = 2 * kPi * static_cast<double>(i / 2) / static_cast<double>((count + 1) / 2);
    const double r = radius_m + (inside ? -kBesideM : kBesideM);
    corners.push_back({{r * std::sin(around), radius_m - r * std::cos(around)},
                       WrapAngle(1.7 * static_cast<double>(i)),
                       inside ? 1.5 : -1.5});
  }
  return corners;
}

}  // namespace

double CostExponent(const std::vector<CostPoint>& points) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const CostPoint& point : points) {
    const double x = std::log(static_cast<double>(point.landmarks)), y = std::log(point.step_ms);
    n += 1, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

CostPoint StudyCost(slam::FilterKind kind, std::size_t corners, std::uint64_t seed) {
  slam::FilterOptions options;
  // The drift is so small that landmarks of the previous round are recognised, however large the ring is.
  options.back_end.drift = {0.0001, 0.001, 0.0002, 0.00002, 0.0002, 0.0005};
  options.back_end.landmarks.noise = {0.04, 0.01, 0.02};
  options.ekf.max_landmarks = static_cast<std::int64_t>(2 * corners);  // No landmark is left out.
  const auto filter = slam::MakeFilter(kind, options, {}, seed);
  slam::Rng rng(seed);
  const double round_m = kCornerApartM * static_cast<double>((corners + 1) / 2);
  const double radius_m = round_m / (2 * kPi), turn = kRingStepM / radius_m;
  const std::vector<Corner> ring = Ring(corners, radius_m);
  const int steps = static_cast<int>(round_m / kRingStepM);
  const Scan scan;
  const Pose2 step{radius_m * std::sin(turn), radius_m * (1 - std::cos(turn)), turn};
  Pose2 truth;
  CostPoint point;
  for (int i = 0; i < 2 * steps; ++i) {
    const slam::ScanView view = SeenCorners(ring, truth, options.back_end.landmarks.noise, 1.0, rng);
    const Stopwatch watch;
    if (i > 0) filter->Predict({step});
    filter->Observe({scan, view, truth, kRingStepM * i}, slam::SerialFor);
    filter->Commit();
    if (i >= steps) point.step_ms += watch.CpuMs() / steps;
    truth = truth * step;
  }
  point.landmarks = filter->landmarks().size();
  return point;
}

}  // namespace cairn::studies
