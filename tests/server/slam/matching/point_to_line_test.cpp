#include "server/slam/matching/point_to_line.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "common/geometry/pose_difference.h"
#include "server/slam/matching/point_index.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::Look;
using test::World;

std::vector<SurfacePoint> SurfaceOf(const Scan& scan, const SurfaceOptions& options = {}) {
  return SurfacePointsOf(PointsOf(scan), scan, options);
}

// The reference holds what the robot sees from the world's origin.
PointIndex ReferenceOf(const World& world, const Laser& laser) {
  return PointIndex(SurfaceOf(Look(world, {}, laser)));
}

const Eigen::Matrix3d kPrior = Eigen::Vector3d(0.09, 0.09, 0.04).asDiagonal();

TEST(PointToLine, FindsTheWayBackFromSeveralStartingErrors) {
  const Laser laser{.beams = 361, .step_rad = Radians(0.5)};
  const PointIndex reference = ReferenceOf(test::Office(), laser);
  const Pose2 truth{0.12, -0.08, 0.06};
  const std::vector<SurfacePoint> points = SurfaceOf(Look(test::Office(), truth, laser));
  for (const Pose2 error : {Pose2{}, Pose2{0.1, 0.1, 0.05}, Pose2{-0.15, 0.05, -0.1}, Pose2{0.0, -0.2, 0.12}}) {
    const Pose2 guess = truth * error;
    const MatchResult match = AlignPointsToSurfaces(points, reference, {guess, guess, kPrior}, {});
    ASSERT_TRUE(match.converged);
    EXPECT_LT((match.T_ref_curr.translation() - truth.translation()).norm(), 0.01);
    EXPECT_LT(std::abs(AngleDiff(match.T_ref_curr.theta, truth.theta)), 0.004);
    EXPECT_TRUE(IsCovariance(match.covariance));
    EXPECT_FALSE(match.degenerate);
  }
}

// The plain form: all points in every iteration, and the pair distance shrinks over six of them in any case.
Pose2 AlignPlainly(const std::vector<SurfacePoint>& points, const std::vector<SurfacePoint>& reference,
                   const Pose2& guess, const PointToLineOptions& options) {
  const double per_point = 1.0 / (options.residual_sigma_m * options.residual_sigma_m);
  const Eigen::Matrix3d prior = kPrior.inverse();
  Pose2 T = guess;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const double shrink = std::min(1.0, iteration / 6.0);
    const double gate =
        options.first_pair_distance_m + shrink * (options.last_pair_distance_m - options.first_pair_distance_m);
    const double scale = std::max(options.residual_sigma_m, options.cauchy_share * gate);
    Eigen::Matrix3d H = prior;
    Eigen::Vector3d g = prior * Minus(T, guess);
    const Eigen::Matrix2d R = T.rotation();
    for (const SurfacePoint& point : points) {
      const Eigen::Vector2d turned = R * point.p, p = turned + T.translation();
      const SurfacePoint* nearest = nullptr;
      for (const SurfacePoint& other : reference)
        if ((other.p - p).norm() < (nearest != nullptr ? (nearest->p - p).norm() : gate)) nearest = &other;
      if (nearest == nullptr) continue;
      const Eigen::Vector2d offset = p - nearest->p;
      Eigen::Vector2d normal = nearest->normal;
      double trust = 1.0;
      if (nearest->smooth() && point.smooth()) {
        if ((R * point.normal).dot(normal) < options.same_side) continue;
      } else if (!nearest->smooth()) {
        if (offset.norm() < 1e-6) continue;
        normal = offset.normalized();
        trust = options.rough_trust;
      }
      const double residual = normal.dot(offset);
      const double weight = trust / (1.0 + residual * residual / (scale * scale));
      const Eigen::Vector3d J(normal.x(), normal.y(), normal.dot(Eigen::Vector2d(-turned.y(), turned.x())));
      H += per_point * weight * J * J.transpose();
      g += per_point * weight * residual * J;
    }
    T = Plus(T, -H.inverse() * g);
  }
  return T;
}

// A sample of the points finds the way; where it ends is decided by all of them.
TEST(PointToLine, EndsWhereAllPointsInEveryIterationEnd) {
  const Laser laser{.beams = 361, .step_rad = Radians(0.5), .sigma_m = 0.01};
  std::mt19937_64 rng(7);
  std::uniform_real_distribution<double> off(-0.15, 0.15), turn(-0.1, 0.1);
  std::vector<SurfacePoint> reference;  // Several scans, as the front-end has them.
  for (int k = 0; k < 6; ++k) {
    const Pose2 T_ref_robot{0.05 * k, 0.02 * k, 0.03 * k};
    for (const SurfacePoint& point : SurfaceOf(Look(test::Office(), T_ref_robot, laser, &rng)))
      reference.push_back({T_ref_robot * point.p, T_ref_robot.rotation() * point.normal});
  }
  const PointIndex index(reference);
  for (int run = 0; run < 20; ++run) {
    const Pose2 truth{off(rng), off(rng), turn(rng)}, guess = truth * Pose2{off(rng), off(rng), turn(rng)};
    const std::vector<SurfacePoint> points = SurfaceOf(Look(test::Office(), truth, laser, &rng));
    ASSERT_GT(points.size(), 200U) << "more than a sample";
    const Pose2 plain = AlignPlainly(points, reference, guess, {});
    const MatchResult match = AlignPointsToSurfaces(points, index, {guess, guess, kPrior}, {});
    ASSERT_TRUE(match.converged);
    EXPECT_LT((match.T_ref_curr.translation() - plain.translation()).norm(), 0.002) << run;
    EXPECT_LT(std::abs(AngleDiff(match.T_ref_curr.theta, plain.theta)), 0.001) << run;
    EXPECT_LT((match.T_ref_curr.translation() - truth.translation()).norm(), 0.015) << run;
  }
}

TEST(PointToLine, SaysThatACorridorHoldsOnlyOneDirection) {
  World corridor;
  corridor.Add({{-50, 1}, {50, 1}}).Add({{-50, -1}, {50, -1}});
  // Far hits are a metre apart on these walls, so a wall's direction is visible only from several of them.
  const Laser laser{.beams = 361, .step_rad = Radians(0.5)};
  const PointIndex reference = ReferenceOf(corridor, laser);
  const std::vector<SurfacePoint> points = SurfaceOf(Look(corridor, {0.3, 0.05, 0.03}, laser));
  const Pose2 guess{0.4, 0.0, 0.0};
  const MatchResult match = AlignPointsToSurfaces(points, reference, {guess, guess, kPrior}, {});
  ASSERT_TRUE(match.converged);
  EXPECT_TRUE(match.degenerate);
  EXPECT_GT(std::abs(match.degenerate_direction.x()), 0.99);
  EXPECT_NEAR(match.T_ref_curr.y, 0.05, 0.01);  // The walls determine y.
  EXPECT_NEAR(match.T_ref_curr.theta, 0.03, 0.005);
  // Nothing determines x, so the answer stays near guess and truth, which are 0.1 m apart, and reports a
  // large uncertainty.
  EXPECT_NEAR(match.T_ref_curr.x, 0.35, 0.1);
  EXPECT_GT(match.covariance(0, 0), 20.0 * match.covariance(1, 1));
}

TEST(PointToLine, WithoutPointsTheAnswerIsThePrior) {
  const PointIndex reference = ReferenceOf(test::Office(), {});
  const MatchResult match = AlignPointsToSurfaces({}, reference, {{1, 0, 0}, {2, 0, 0}, kPrior}, {});
  EXPECT_FALSE(match.converged);
  EXPECT_EQ(match.failure, MatchFailure::kTooFewFeatures);
  EXPECT_EQ(match.T_ref_curr, (Pose2{2, 0, 0}));
}

TEST(PointToLine, ScansOfDifferentPlacesDoNotConverge) {
  const PointIndex reference = ReferenceOf(test::Room(-8, -8, 16, 16), {});
  const std::vector<SurfacePoint> points = SurfaceOf(Look(test::Office(), {}, {}));
  EXPECT_FALSE(AlignPointsToSurfaces(points, reference, {{}, {}, kPrior}, {}).converged);
}

}  // namespace
}  // namespace cairn::slam
