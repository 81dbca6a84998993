#include "server/slam/matching/point_to_line.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>
#include <span>
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

// Seen from elsewhere: the scan has little in common with the reference.
TEST(PointToLine, IsGivenUpWhereTooLittleIsExplainedToBeOfUse) {
  const Laser laser{.beams = 361, .step_rad = Radians(0.5)};
  const PointIndex reference = ReferenceOf(test::Office(), laser);
  const Pose2 guess{0.1, 0.05, 0.02};
  const std::vector<SurfacePoint> elsewhere = SurfaceOf(Look(test::Office(), {1.5, 1.0, 2.0}, laser));
  const MatchResult to_the_end = AlignPointsToSurfaces(elsewhere, reference, {guess, guess, kPrior}, {});
  ASSERT_LT(to_the_end.score, 0.6);
  ASSERT_GT(to_the_end.iterations, 3);
  const MatchResult given_up = AlignPointsToSurfaces(elsewhere, reference, {guess, guess, kPrior, 0.7, 2}, {});
  EXPECT_FALSE(given_up.converged);
  EXPECT_EQ(given_up.failure, MatchFailure::kNotConverged);
  EXPECT_EQ(given_up.iterations, 2);
  EXPECT_EQ(given_up.T_ref_curr, guess);
  EXPECT_EQ(given_up.covariance, kPrior);
}

TEST(PointToLine, IsTheSameWhereEnoughIsExplained) {
  const Laser laser{.beams = 361, .step_rad = Radians(0.5)};
  const PointIndex reference = ReferenceOf(test::Office(), laser);
  const std::vector<SurfacePoint> points = SurfaceOf(Look(test::Office(), {0.12, -0.08, 0.06}, laser));
  // At first few points are explained, because the start is far off: that is not judged yet.
  const Pose2 guess{0.35, 0.1, 0.2};
  const MatchResult match = AlignPointsToSurfaces(points, reference, {guess, guess, kPrior}, {});
  ASSERT_TRUE(match.converged);
  const MatchResult same = AlignPointsToSurfaces(points, reference, {guess, guess, kPrior, 0.55, 2}, {});
  EXPECT_TRUE(same.converged);
  EXPECT_EQ(same.T_ref_curr, match.T_ref_curr);
  EXPECT_EQ(same.covariance, match.covariance);
  EXPECT_EQ(same.iterations, match.iterations);
}

// The plain form: every search looks at all reference points, and the equations are written as matrices.
struct Plain {
  const std::vector<SurfacePoint>& points;
  const std::vector<SurfacePoint>& reference;
  PointToLineOptions options;

  struct Sums {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero(), H_surfaces = H;
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    int inliers = 0;
  };
  [[nodiscard]] Sums At(const Pose2& T, double gate) const {
    Sums sum;
    const double c = std::cos(T.theta), s = std::sin(T.theta);
    const double scale = std::max(options.residual_sigma_m, options.cauchy_share * gate);
    for (const SurfacePoint& point : points) {
      const Eigen::Vector2d turned(c * point.p.x() - s * point.p.y(), s * point.p.x() + c * point.p.y());
      const Eigen::Vector2d p = turned + T.translation();
      const auto nearest =
          std::ranges::min_element(reference, {}, [&](const auto& r) { return (r.p - p).squaredNorm(); });
      if ((nearest->p - p).squaredNorm() >= gate * gate) continue;
      Eigen::Vector2d normal = nearest->normal;
      double trust = 1.0;
      if (nearest->smooth() && point.smooth()) {
        const Eigen::Vector2d own(c * point.normal.x() - s * point.normal.y(),
                                  s * point.normal.x() + c * point.normal.y());
        if (own.dot(normal) < options.same_side) continue;
      } else if (!nearest->smooth()) {
        const double distance = (p - nearest->p).norm();
        if (distance < 1e-6) continue;
        normal = (p - nearest->p) / distance;
        trust = options.rough_trust;
      }
      const double residual = normal.dot(p - nearest->p);
      const double weight = trust / (1.0 + (residual / scale) * (residual / scale));
      const Eigen::Vector3d J(normal.x(), normal.y(), normal.dot(Eigen::Vector2d(-turned.y(), turned.x())));
      sum.H.noalias() += weight * J * J.transpose();
      if (nearest->smooth()) sum.H_surfaces.noalias() += weight * J * J.transpose();
      sum.g.noalias() += weight * residual * J;
      if (std::abs(residual) < options.inlier_distance_m) ++sum.inliers;
    }
    return sum;
  }
  [[nodiscard]] MatchResult Align(const Pose2& guess) const {
    const double per_point = 1.0 / (options.residual_sigma_m * options.residual_sigma_m);
    const Eigen::Matrix3d prior = kPrior.llt().solve(Eigen::Matrix3d::Identity());
    MatchResult result;
    Pose2& T = result.T_ref_curr = guess;
    for (bool settled = false; result.iterations < options.max_iterations && !settled; ++result.iterations) {
      const double shrink = std::min(1.0, result.iterations / static_cast<double>(options.shrink_iterations));
      const Sums sum = At(
          T, options.first_pair_distance_m + shrink * (options.last_pair_distance_m - options.first_pair_distance_m));
      const Eigen::Matrix3d H = per_point * sum.H + prior;
      const Eigen::Vector3d step = -H.ldlt().solve(per_point * sum.g + prior * Minus(T, guess));
      T = Plus(T, step);
      settled = shrink >= 1.0 && step.head<2>().norm() < options.stop_step_m && std::abs(step.z()) < 2e-4;
    }
    const Sums sum = At(T, options.last_pair_distance_m);
    result.inliers = sum.inliers;
    result.covariance = (per_point * sum.H + prior).llt().solve(Eigen::Matrix3d::Identity());
    result.covariance = 0.5 * (result.covariance + result.covariance.transpose()).eval();
    DetectDegeneracy(per_point * sum.H_surfaces, result);
    return result;
  }
};

TEST(PointToLine, IsThePlainFormToTheLastBit) {
  const Laser laser{.beams = 181, .step_rad = Radians(1.0), .sigma_m = 0.01};
  std::mt19937_64 rng(7);
  std::uniform_real_distribution<double> off(-0.15, 0.15), turn(-0.1, 0.1);
  World corridor;
  corridor.Add({{-50, 1}, {50, 1}}).Add({{-50, -1}, {50, -1}});
  int degenerate = 0, rough = 0;
  for (const World& world : {test::Office(), corridor}) {
    std::vector<SurfacePoint> reference;  // Several scans, as the front-end has them.
    for (int k = 0; k < 6; ++k) {
      const Pose2 T_ref_robot{0.05 * k, 0.02 * k, 0.03 * k};
      for (const SurfacePoint& point : SurfaceOf(Look(world, T_ref_robot, laser, &rng)))
        reference.push_back({T_ref_robot * point.p, T_ref_robot.rotation() * point.normal});
    }
    rough += static_cast<int>(std::ranges::count_if(reference, [](const auto& point) { return !point.smooth(); }));
    const PointIndex index(reference);
    for (int run = 0; run < 10; ++run) {
      const Pose2 truth{off(rng), off(rng), turn(rng)}, guess = truth * Pose2{off(rng), off(rng), turn(rng)};
      const std::vector<SurfacePoint> points = SurfaceOf(Look(world, truth, laser, &rng));
      const MatchResult plain = Plain{points, reference, {}}.Align(guess);
      const MatchResult match = AlignPointsToSurfaces(points, index, {guess, guess, kPrior}, {});
      ASSERT_TRUE(match.converged);
      EXPECT_EQ(match.T_ref_curr, plain.T_ref_curr) << run;
      EXPECT_EQ(match.covariance, plain.covariance) << run;
      EXPECT_EQ(match.iterations, plain.iterations) << run;
      EXPECT_EQ(match.inliers, plain.inliers) << run;
      EXPECT_EQ(match.degenerate, plain.degenerate) << run;
      if (plain.degenerate) {
        EXPECT_EQ(match.degenerate_direction, plain.degenerate_direction) << run;
      }
      degenerate += plain.degenerate ? 1 : 0;
    }
  }
  EXPECT_EQ(degenerate, 10);
  EXPECT_GT(rough, 10);
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

// The walls of a corridor whose hits have noise, and the same with a pillar at one of them.
MatchResult InACorridor(bool pillar) {
  World corridor;
  corridor.Add({{-50, 1}, {50, 1}}).Add({{-50, -1}, {50, -1}});
  if (pillar) corridor.Add({{4.0, 1}, {4.0, 0.9}, {4.3, 0.9}, {4.3, 1}});
  const Laser laser{.beams = 361, .step_rad = Radians(0.5), .sigma_m = 0.01};
  std::mt19937_64 rng(3);
  const PointIndex reference(SurfaceOf(Look(corridor, {}, laser, &rng)));
  return AlignPointsToSurfaces(SurfaceOf(Look(corridor, {0.1, 0.0, 0.0}, laser, &rng)), reference,
                               {{0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}, kPrior}, {});
}

TEST(PointToLine, SaysHowMuchOfTheWayAlongACorridorSurfacesShow) {
  const MatchResult bare = InACorridor(false), pillar = InACorridor(true);
  ASSERT_TRUE(bare.degenerate);
  ASSERT_TRUE(pillar.degenerate);
  EXPECT_LT(bare.open_information, 1.0 / (1.0 * 1.0)) << "noise in the directions of the walls shows no position";
  EXPECT_GT(pillar.open_information, 1.0 / (0.1 * 0.1));
}

TEST(PointToLine, AlongACorridorTheAnswerIsWeighedWithThePrior) {
  MatchResult match = InACorridor(false);
  match.T_ref_curr = {1.0, 0.2, 0.1};
  match.degenerate_direction = {1.0, 0.0};
  const MatchPrior prior{{3.0, 0.5, 0.3}, PoseCovariance(0.1, 0.5)};
  match.open_information = 0.0;
  MatchResult weighed = match;
  WeighAlongWithPrior(prior, weighed);
  EXPECT_EQ(weighed.T_ref_curr, (Pose2{3.0, 0.2, 0.1}));
  EXPECT_NEAR(weighed.covariance(0, 0), 0.01, 1e-12);
  match.open_information = 300.0;  // Three times as much as that of the prior.
  weighed = match;
  WeighAlongWithPrior(prior, weighed);
  EXPECT_NEAR(weighed.T_ref_curr.x, 1.5, 1e-12);
  EXPECT_EQ(weighed.T_ref_curr.y, 0.2);
  EXPECT_NEAR(weighed.covariance(0, 0), 0.0025, 1e-12);
  EXPECT_EQ(weighed.open_information, 300.0);
  match.degenerate = false;
  WeighAlongWithPrior(prior, match);
  EXPECT_EQ(match.T_ref_curr, (Pose2{1.0, 0.2, 0.1}));
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
