#include "common/cloud/map_entropy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace cairn {
namespace {

Eigen::Vector3f Point(double x, double y) {
  return {static_cast<float>(x), static_cast<float>(y), 0.0F};
}

double EntropyOf(double determinant) {
  return 0.5 * std::log(std::pow(2.0 * std::numbers::pi * std::numbers::e, 2) * determinant);
}

PointCloud NormalCloud(double sigma_m, int points) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, sigma_m);
  PointCloud cloud;
  for (int i = 0; i < points; ++i) {
    const double x = normal(random);
    cloud.push_back(Point(x, normal(random)));
  }
  return cloud;
}

// Every point lies within the radius of every other one.
TEST(MapEntropy, OfANormalDistributionIsItsFormula) {
  for (const double sigma_m : {0.02, 0.2}) {
    const auto map = MapEntropy(NormalCloud(sigma_m, 2000), {.radius_m = 10.0});
    ASSERT_TRUE(map) << map.error().message;
    EXPECT_EQ(map->places, 2000U);
    EXPECT_NEAR(map->mean_entropy, EntropyOf(std::pow(sigma_m, 4)), 0.1);
    EXPECT_NEAR(map->thickness_m, sigma_m, 0.07 * sigma_m);
  }
}

// A wall whose points lie on two lines: the covariance is known exactly.
TEST(MapEntropy, OfAStripIsThatOfItsCovariance) {
  constexpr int kColumns = 41;
  PointCloud cloud;
  double sum = 0.0;
  for (int i = 0; i < kColumns; ++i) {
    const double along_m = 0.01 * (i - kColumns / 2);
    sum += 2.0 * along_m * along_m;
    cloud.push_back(Point(along_m, 0.03));
    cloud.push_back(Point(along_m, -0.03));
  }
  const double n = 2.0 * kColumns;
  const double along_m2 = sum / (n - 1.0), across_m2 = 0.03 * 0.03 * n / (n - 1.0);
  const auto map = MapEntropy(cloud, {.radius_m = 1.0});
  ASSERT_TRUE(map);
  EXPECT_NEAR(map->mean_entropy, EntropyOf(along_m2 * across_m2), 1e-3);
  EXPECT_NEAR(map->thickness_m, std::sqrt(across_m2), 1e-5);
}

// All pairs of points instead of cells; on both sides of the origin, and with many cells.
TEST(MapEntropy, LooksAtAllPointsWithinTheRadiusAndAtNoOthers) {
  constexpr double kRadius_m = 0.3;
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> place(-1.0, 1.0);
  PointCloud cloud;
  for (int i = 0; i < 600; ++i) {
    const double x = place(random);
    cloud.push_back(Point(x, place(random)));
  }
  double sum = 0.0;
  std::size_t places = 0;
  for (const Eigen::Vector3f& at : cloud) {
    std::vector<Eigen::Vector2d> near;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Eigen::Vector3f& p : cloud) {
      const Eigen::Vector2d way = (p.cast<double>() - at.cast<double>()).head<2>();
      if (way.norm() > kRadius_m) continue;
      near.push_back(way);
      mean += way;
    }
    if (near.size() < 10) continue;
    mean /= static_cast<double>(near.size());
    Eigen::Matrix2d S = 1e-8 * Eigen::Matrix2d::Identity();
    for (const Eigen::Vector2d& way : near)
      S += (way - mean) * (way - mean).transpose() / static_cast<double>(near.size() - 1);
    sum += EntropyOf(S.determinant());
    ++places;
  }
  const auto map = MapEntropy(cloud, {.radius_m = kRadius_m});
  ASSERT_TRUE(map);
  EXPECT_GT(places, 500U);
  EXPECT_EQ(map->places, places);
  EXPECT_NEAR(map->mean_entropy, sum / static_cast<double>(places), 1e-9);
}

TEST(MapEntropy, OfAWallThatIsDrawnTwiceIsHigher) {
  PointCloud one;
  for (int i = 0; i < 400; ++i) one.push_back(Point(0.005 * i, 1.0));
  PointCloud two = one;
  for (int i = 0; i < 400; ++i) two.push_back(Point(0.005 * i, 1.1));
  const auto crisp = MapEntropy(one), blurred = MapEntropy(two);
  ASSERT_TRUE(crisp);
  ASSERT_TRUE(blurred);
  EXPECT_LT(crisp->thickness_m, 0.001);
  EXPECT_NEAR(blurred->thickness_m, 0.05, 0.002);
  EXPECT_GT(blurred->mean_entropy, crisp->mean_entropy + 2.0);
}

TEST(MapEntropy, BadPointsAreLeftOut) {
  PointCloud cloud = NormalCloud(0.05, 200);
  const auto good = MapEntropy(cloud, {.radius_m = 10.0});
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();
  for (const float bad : {kNan, kInfinity, -kInfinity, 1e30F}) {
    cloud.emplace_back(bad, 0.0F, 0.0F);
    cloud.emplace_back(0.0F, bad, 0.0F);
  }
  const auto map = MapEntropy(cloud, {.radius_m = 10.0});
  ASSERT_TRUE(good);
  ASSERT_TRUE(map);
  EXPECT_EQ(map->places, 200U);
  EXPECT_DOUBLE_EQ(map->mean_entropy, good->mean_entropy);
}

TEST(MapEntropy, TooFewPointsAndImpossibleRadiiAreErrors) {
  EXPECT_FALSE(MapEntropy({}));
  EXPECT_FALSE(MapEntropy(NormalCloud(0.05, 9), {.radius_m = 10.0}));
  EXPECT_TRUE(MapEntropy(NormalCloud(0.05, 10), {.radius_m = 10.0}));
  for (const double radius_m : {0.0, -1.0, 1e4, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_FALSE(MapEntropy(NormalCloud(0.05, 100), {.radius_m = radius_m})) << radius_m;
}

}  // namespace
}  // namespace cairn
