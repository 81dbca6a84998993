#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>

#include "common/geometry/pose2.h"

namespace cairn {
namespace {

TEST(IsCovariance, AcceptsSymmetricPositiveSemiDefinite) {
  EXPECT_TRUE(IsCovariance(Eigen::Matrix3d::Identity()));
  EXPECT_TRUE(IsCovariance(Eigen::Matrix3d::Zero()));
  const Eigen::Vector3d v(1, -2, 3);
  EXPECT_TRUE(IsCovariance(v * v.transpose()));  // Rank one.
  EXPECT_TRUE(IsCovariance(1e-14 * v * v.transpose()));
}

TEST(IsCovariance, RefusesANegativeDirection) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(2, 2) = -1e-3;
  EXPECT_FALSE(IsCovariance(matrix));
  matrix = Eigen::Matrix3d::Identity();
  matrix(0, 1) = matrix(1, 0) = 1.5;  // Correlation above one.
  EXPECT_FALSE(IsCovariance(matrix));
}

TEST(IsCovariance, RefusesAsymmetryBeyondTheScalesTolerance) {
  Eigen::Matrix3d matrix = 1e-6 * Eigen::Matrix3d::Identity();
  matrix(0, 1) = 1e-8;
  EXPECT_FALSE(IsCovariance(matrix));
  matrix(0, 1) = 1e-17;
  EXPECT_TRUE(IsCovariance(matrix));
}

TEST(IsCovariance, RefusesNanAndInfinity) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(IsCovariance(matrix));
  matrix(1, 1) = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(IsCovariance(matrix));
}

}  // namespace
}  // namespace cairn
