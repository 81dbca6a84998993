#include "server/slam/matchers/ndt_map.h"

#include <gtest/gtest.h>

#include <limits>

#include "server/slam/features/scan_view.h"
#include "tests/numerical_derivative.h"
#include "tests/server/slam/matchers/ndt_worlds.h"

namespace cairn::slam {
namespace {

using Points = std::vector<Eigen::Vector2d>;

Points OfficePoints(const Pose2& T_world_robot = {}) {
  return PositionsOf(test::ViewFrom(test::Office(), T_world_robot));
}

double SumOfDensities(const NdtMap& map, const Points& points, const Pose2& T) {
  double sum = 0.0;
  for (const Eigen::Vector2d& p : points) sum += map.Density(T * p);
  return sum;
}

// Four points in the square (0, 0.5)^2: in the plain grid and in each shifted one they share a cell, so the
// density is four times the one normal distribution of (2.13).
TEST(NdtMap, ADensityIsTheSumOfFourNormalDistributions) {
  const Points points = {{0.1, 0.2}, {0.4, 0.2}, {0.1, 0.3}, {0.4, 0.3}};
  const NdtMap map(points, {});
  // By hand: mean (0.25, 0.25), variances 0.15^2 and 0.05^2 (thirds of them are not taken: (2.12) divides by
  // n).
  const auto expected = [](double x, double y) {
    return 4.0 * std::exp(-0.5 * (std::pow((x - 0.25) / 0.15, 2) + std::pow((y - 0.25) / 0.05, 2)));
  };
  EXPECT_NEAR(map.Density({0.25, 0.25}), 4.0, 1e-12);
  EXPECT_NEAR(map.Density({0.3, 0.22}), expected(0.3, 0.22), 1e-12);
  // At x = 0.7, the cell of the grid that is shifted by half a cell in x no longer contains the place; half
  // of the four cells do.
  EXPECT_NEAR(map.Density({0.7, 0.25}), 0.5 * expected(0.7, 0.25), 1e-12);
  EXPECT_EQ(map.Density({3.0, 3.0}), 0.0);
}

TEST(NdtMap, CellsLieWhereThePlaneSaysNotWhereThePointsBegin) {
  // The same cloud with an additional far point: the densities near the cloud must not change.
  Points points = {{0.1, 0.2}, {0.4, 0.2}, {0.1, 0.3}, {0.4, 0.3}};
  const double alone = NdtMap(points, {}).Density({0.3, 0.22});
  points.insert(points.begin(), {-7.3, 12.9});
  EXPECT_NEAR(NdtMap(points, {}).Density({0.3, 0.22}), alone, 1e-12);
}

// Single precision is enough at every place, because means are stored relative to the corners of their half
// cells.
TEST(NdtMap, TheScoreIsTheSumOfTheDensities) {
  for (const Pose2& place : {Pose2{}, Pose2{31000.25, -47000.5, 1.0}}) {
    Points points = OfficePoints();
    for (Eigen::Vector2d& p : points) p = place * p;
    const NdtMap map(points, {});
    const Pose2 off{0.013, -0.02, 0.0};
    const double sum = SumOfDensities(map, points, off);
    EXPECT_GT(sum, 50.0);
    EXPECT_NEAR(map.Score(points, off), sum, 1e-5 * sum);
    EXPECT_NEAR(map.Derivatives(points, off).score, sum, 1e-9 * sum);
    EXPECT_LT(map.Score(points, off * Pose2{40.0, 40.0, 0.0}), 1e-6);  // Absent distributions add nothing.
  }
}

TEST(NdtMap, TwoPointsMakeNoDistributionAndThreeEqualOnesNeither) {
  EXPECT_TRUE(NdtMap(Points{{0, 0}, {0.1, 0}}, {}).empty());
  EXPECT_TRUE(NdtMap(Points{{0.2, 0.2}, {0.2, 0.2}, {0.2, 0.2}}, {}).empty());
  EXPECT_FALSE(NdtMap(Points{{0.2, 0.2}, {0.3, 0.2}, {0.4, 0.2}}, {}).empty());
}

TEST(NdtMap, NoPointIsTooBadOrTooFar) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(NdtMap(Points{}, {}).empty());
  EXPECT_TRUE(NdtMap(Points{{nan, 1}, {inf, 0}}, {}).empty());
  const NdtMap map(OfficePoints(), {});
  EXPECT_EQ(map.Density({nan, 0}), 0.0);
  EXPECT_EQ(map.Density({1e300, -inf}), 0.0);
  EXPECT_EQ(map.Score(Points{{0, 0}}, {nan, 0, nan}), 0.0);
  // A point at a distance of a thousand kilometres takes no additional memory, and the other points stay.
  Points far = OfficePoints();
  const std::size_t all = far.size();
  far.resize(all + 1, Eigen::Vector2d(9000, 0));
  EXPECT_FALSE(NdtMap(far, {}).empty());
  NdtMap(Points{{1e18, 0}, {-1e18, 1e18}, {0, 0}}, {});
}

TEST(NdtMap, DerivativesAgreeWithDifferences) {
  const NdtMap map(OfficePoints(), {});
  const Points points = OfficePoints({0.3, -0.2, 0.1});
  // The score is smooth except at the borders of cells, so points nearer than 1 mm to a border are left out.
  int checked = 0;
  for (const Pose2& T : {Pose2{0.3, -0.2, 0.1}, Pose2{0.25, -0.12, 0.13}, Pose2{-0.2, 0.3, -0.3}, Pose2{}}) {
    Points smooth;
    for (const Eigen::Vector2d& p : points) {
      const Eigen::Vector2d q = 2.0 * (T * p);
      if (std::abs(q.x() - std::round(q.x())) > 2e-3 && std::abs(q.y() - std::round(q.y())) > 2e-3) smooth.push_back(p);
    }
    const NdtDerivatives at = map.Derivatives(smooth, T);
    // In double precision, which Score() does not have.
    const auto score = [&](const Eigen::Vector3d& x) {
      return Eigen::Matrix<double, 1, 1>(SumOfDensities(map, smooth, {x.x(), x.y(), x.z()}));
    };
    EXPECT_NEAR(at.score, score(T.vector())(0), 1e-9);
    const auto gradient = [&](const Eigen::Vector3d& x) -> Eigen::Vector3d {
      return map.Derivatives(smooth, {x.x(), x.y(), x.z()}).gradient;
    };
    const Eigen::Vector3d gradient_by_steps = NumericalDerivative<1, 3>(score, T.vector(), 1e-6).transpose();
    const Eigen::Matrix3d hessian_by_steps = NumericalDerivative<3, 3>(gradient, T.vector(), 1e-6);
    EXPECT_LT((at.gradient - gradient_by_steps).norm(), 1e-5 * (1.0 + gradient_by_steps.norm()));
    EXPECT_LT((at.hessian - hessian_by_steps).norm(), 1e-5 * (1.0 + hessian_by_steps.norm()));
    EXPECT_GT(hessian_by_steps.norm(), 1.0);
    ++checked;
  }
  EXPECT_EQ(checked, 4);
}

TEST(NdtMap, TheScoreDoesNotDependOnWhereTheWorldHasItsOrigin) {
  // If map and points are moved by whole cells, the score stays the same.
  const Points points = OfficePoints();
  Points moved;
  for (const Eigen::Vector2d& p : points) moved.push_back(p + Eigen::Vector2d(17, -5));
  const double here = NdtMap(points, {}).Score(points, {0.05, 0.02, 0.01});
  const double there = NdtMap(moved, {}).Score(points, {17.05, -4.98, 0.01});
  EXPECT_NEAR(here, there, 1e-6 * here);
}

}  // namespace
}  // namespace cairn::slam
