#include "common/geometry/pose2.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <random>
#include <vector>

#include "common/geometry/transform2.h"

namespace cairn {
namespace {

std::vector<Pose2> SomePoses() {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> metres(-20.0, 20.0), radians(-kPi, kPi);
  std::vector<Pose2> poses = {{}, {1, 0, 0}, {0, 0, kPi}, {0, 0, -kPi / 2}, {-3, 4, 1e-12}, {1e4, -1e4, 3.1}};
  for (int i = 0; i < 50; ++i) poses.push_back({metres(random), metres(random), radians(random)});
  return poses;
}

void ExpectNear(const Pose2& a, const Pose2& b, double tolerance = 1e-9) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(std::abs(AngleDiff(a.theta, b.theta)), 0.0, tolerance);
}

TEST(Pose2, QuarterTurnByHand) {
  const Pose2 T_map_robot{1, 2, kPi / 2};
  const Eigen::Vector2d p_map = T_map_robot * Eigen::Vector2d(3, 0);  // Three metres ahead.
  EXPECT_NEAR(p_map.x(), 1, 1e-12);
  EXPECT_NEAR(p_map.y(), 5, 1e-12);
}

TEST(Pose2, ATransformMovesPointsAsItsPoseDoes) {
  for (const Pose2& T : SomePoses()) {
    const Transform2 transform(T);
    for (const Pose2& other : SomePoses()) EXPECT_EQ(transform * other.translation(), T * other.translation());
  }
}

TEST(Pose2, InverseUndoesFromBothSides) {
  for (const Pose2& T : SomePoses()) {
    ExpectNear(T * T.Inverse(), Pose2{});
    ExpectNear(T.Inverse() * T, Pose2{});
  }
}

TEST(Pose2, IdentityChangesNothing) {
  for (const Pose2& T : SomePoses()) {
    ExpectNear(T * Pose2{}, T);
    ExpectNear(Pose2{} * T, T);
  }
}

TEST(Pose2, ProductIsAssociativeAndActsOnPointsInTurn) {
  const auto poses = SomePoses();
  const Eigen::Vector2d p(0.7, -1.3);
  for (std::size_t i = 0; i + 2 < poses.size(); ++i) {
    const Pose2 &A = poses[i], &B = poses[i + 1], &C = poses[i + 2];
    ExpectNear((A * B) * C, A * (B * C));
    EXPECT_NEAR(((A * B) * p - A * (B * p)).norm(), 0.0, 1e-9);
  }
}

TEST(Pose2, BetweenIsInverseTimes) {
  const auto poses = SomePoses();
  for (std::size_t i = 0; i + 1 < poses.size(); ++i) {
    ExpectNear(Between(poses[i], poses[i + 1]), poses[i].Inverse() * poses[i + 1], 1e-8);
    ExpectNear(poses[i] * Between(poses[i], poses[i + 1]), poses[i + 1], 1e-8);
  }
}

TEST(Pose2, HeadingsStayWrapped) {
  const auto poses = SomePoses();
  for (std::size_t i = 0; i + 1 < poses.size(); ++i) {
    for (const double theta : {(poses[i] * poses[i + 1]).theta, poses[i].Inverse().theta,
                               Between(poses[i], poses[i + 1]).theta, Interpolate(poses[i], poses[i + 1], 0.3).theta}) {
      EXPECT_GT(theta, -kPi);
      EXPECT_LE(theta, kPi);
    }
  }
}

TEST(Pose2, RotationMatrixTurnsAsTheProductDoes) {
  const Pose2 T{0, 0, 0.4};
  const Eigen::Vector2d p(1.5, -2.0);
  EXPECT_NEAR((T.rotation() * p - T * p).norm(), 0.0, 1e-15);
  EXPECT_NEAR(T.rotation().determinant(), 1.0, 1e-15);
}

TEST(Pose2, InterpolatesAcrossTheWrap) {
  const Pose2 middle = Interpolate({0, 0, Radians(170)}, {2, 4, Radians(-170)}, 0.5);
  ExpectNear(middle, {1, 2, kPi});
  ExpectNear(Interpolate({1, 1, 1}, {5, 5, 2}, 0.0), {1, 1, 1});
  ExpectNear(Interpolate({1, 1, 1}, {5, 5, 2}, 1.0), {5, 5, 2});
}

TEST(Pose2, NotFiniteWithNanOrInfinity) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE((Pose2{1, 2, 3}.IsFinite()));
  EXPECT_FALSE((Pose2{kNan, 2, 3}.IsFinite()));
  EXPECT_FALSE((Pose2{1, -kInf, 3}.IsFinite()));
  EXPECT_FALSE((Pose2{1, 2, kNan}.IsFinite()));
}

}  // namespace
}  // namespace cairn
