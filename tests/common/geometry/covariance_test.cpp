#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "common/geometry/pose2.h"
#include "common/geometry/rotated_covariance.h"

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

// A robot that is unsure along its own x is unsure along y where it looks along y.
TEST(Rotated, TurnsTheEllipseAndLeavesTheHeading) {
  Eigen::Matrix3d covariance = Eigen::Vector3d(4.0, 1.0, 0.5).asDiagonal();
  covariance(0, 2) = covariance(2, 0) = 0.3;
  const double quarter_turn = std::acos(0.0);
  const Eigen::Matrix3d turned = Rotated(covariance, quarter_turn);
  Eigen::Matrix3d expected = Eigen::Vector3d(1.0, 4.0, 0.5).asDiagonal();
  expected(1, 2) = expected(2, 1) = 0.3;
  EXPECT_TRUE(turned.isApprox(expected, 1e-12)) << turned;
  EXPECT_TRUE(Rotated(turned, -quarter_turn).isApprox(covariance, 1e-12));
  const Eigen::Matrix3f in_floats = covariance.cast<float>();
  EXPECT_TRUE(Rotated(in_floats, quarter_turn).isApprox(expected.cast<float>(), 1e-6F));
}

}  // namespace
}  // namespace cairn
