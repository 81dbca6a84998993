#include "common/cloud/map_entropy.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

namespace cairn {
namespace {

bool IsPlausible(const Eigen::Vector3f& p) {
  constexpr double kFarthest_m = 1e6;
  return std::abs(static_cast<double>(p.x())) <= kFarthest_m && std::abs(static_cast<double>(p.y())) <= kFarthest_m;
}

// The points of the plane by square cells that are as wide as the radius, so that all points around a place lie in its
// cell and the eight around it.
class CellsOfPoints {
 public:
  CellsOfPoints(const PointCloud& cloud, double radius_m) : radius_m_(radius_m) {
    points_.reserve(cloud.size());
    for (const Eigen::Vector3f& p : cloud) {
      if (IsPlausible(p)) points_.push_back({CellOf(Index(p.y()), Index(p.x())), p.x(), p.y()});
    }
    std::ranges::sort(points_, {}, &CellPoint::cell);
  }

  // Calls `visit` with the way from the place to each point within the radius.
  template <typename Visit>
  void VisitAround(const Eigen::Vector3f& place, const Visit& visit) const {
    const std::uint64_t row = Index(place.y()), column = Index(place.x());
    for (std::uint64_t r = row - 1; r <= row + 1; ++r) {
      // The three cells of a row follow each other.
      const auto first = std::ranges::lower_bound(points_, CellOf(r, column - 1), {}, &CellPoint::cell);
      const std::uint64_t last = CellOf(r, column + 1);
      for (auto point = first; point != points_.end() && point->cell <= last; ++point) {
        const Eigen::Vector2d way(static_cast<double>(point->x) - static_cast<double>(place.x()),
                                  static_cast<double>(point->y) - static_cast<double>(place.y()));
        if (way.squaredNorm() <= radius_m_ * radius_m_) visit(way);
      }
    }
  }

 private:
  struct CellPoint {
    std::uint64_t cell;
    float x, y;
  };
  // Above 0 and below 2^32 for all plausible points, with room for a neighbour on either side.
  [[nodiscard]] std::uint64_t Index(float coordinate) const {
    constexpr double kMiddle = 2147483648.0;  // 2^31.
    return static_cast<std::uint64_t>(std::floor(static_cast<double>(coordinate) / radius_m_) + kMiddle);
  }
  [[nodiscard]] static std::uint64_t CellOf(std::uint64_t row, std::uint64_t column) { return (row << 32U) | column; }

  const double radius_m_;
  std::vector<CellPoint> points_;  // By increasing cell.
};

// The covariance of what it is given.
class Spread {
 public:
  void Add(const Eigen::Vector2d& p) {
    ++count_;
    sum_ += p;
    squares_ += p * p.transpose();
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  // REQUIRES: at least two points.
  [[nodiscard]] Eigen::Matrix2d covariance() const {
    const auto n = static_cast<double>(count_);
    return (squares_ - sum_ * sum_.transpose() / n) / (n - 1.0);
  }

 private:
  std::size_t count_ = 0;
  Eigen::Vector2d sum_ = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares_ = Eigen::Matrix2d::Zero();
};

}  // namespace

Result<MapCrispness> MapEntropy(const PointCloud& cloud, const MapEntropyOptions& options) {
  constexpr std::size_t kPlaces = 50'000;  // The figures change by less than a hundredth with more.
  constexpr std::size_t kFewest = 10;      // Fewer points say nothing about a wall.
  constexpr double kFinest_m2 = 1e-8;      // A tenth of a millimetre: points on a line have an entropy as well.
  if (!(options.radius_m >= 0.001 && options.radius_m <= 1000.0))
    return Fail(StatusCode::kInvalidArgument, "map entropy: the radius must be 0.001 to 1000 m");
  const CellsOfPoints cells(cloud, options.radius_m);
  const double entropy_of_one = std::log(2.0 * std::numbers::pi * std::numbers::e);
  double entropy_sum = 0.0;
  std::vector<double> thicknesses_m;
  const std::size_t stride = std::max<std::size_t>(1, cloud.size() / kPlaces);
  for (std::size_t i = 0; i < cloud.size(); i += stride) {
    if (!IsPlausible(cloud[i])) continue;
    Spread spread;
    cells.VisitAround(cloud[i], [&spread](const Eigen::Vector2d& way) { spread.Add(way); });
    if (spread.count() < kFewest) continue;
    const Eigen::Matrix2d S = spread.covariance() + kFinest_m2 * Eigen::Matrix2d::Identity();
    const double determinant = std::max(S(0, 0) * S(1, 1) - S(0, 1) * S(0, 1), kFinest_m2 * kFinest_m2);
    entropy_sum += entropy_of_one + 0.5 * std::log(determinant);
    const double smaller = 0.5 * (S(0, 0) + S(1, 1)) - std::hypot(0.5 * (S(0, 0) - S(1, 1)), S(0, 1));
    thicknesses_m.push_back(std::sqrt(std::max(0.0, smaller)));
  }
  if (thicknesses_m.empty())
    return Fail(StatusCode::kFailedPrecondition,
                "map entropy: nowhere are " + std::to_string(kFewest) + " points within the radius");
  const auto middle = thicknesses_m.begin() + static_cast<std::ptrdiff_t>(thicknesses_m.size() / 2);
  std::ranges::nth_element(thicknesses_m, middle);
  return MapCrispness{thicknesses_m.size(), entropy_sum / static_cast<double>(thicknesses_m.size()), *middle};
}

}  // namespace cairn
