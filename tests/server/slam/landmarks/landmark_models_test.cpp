// Tests what the three landmark models learn, and that their Jacobians are the derivatives.
#include <gtest/gtest.h>

#include <random>

#include "common/geometry/pose2.h"
#include "server/slam/landmark_variants/landmark_oriented.h"
#include "server/slam/landmark_variants/landmark_point.h"
#include "server/slam/landmarks/landmark_pair.h"
#include "tests/numerical_derivative.h"

namespace cairn::slam {
namespace {

const Pose2 kPose{0.4, -1.2, 0.7};
const LandmarkSighting kSighting{0, {true, 1.5}, {3.0, 1.0}, -0.6};

template <typename Model>
class LandmarkModels : public testing::Test {};
using Models = testing::Types<LandmarkPair, LandmarkOriented, LandmarkPoint>;
TYPED_TEST_SUITE(LandmarkModels, Models);

TYPED_TEST(LandmarkModels, StartWhereTheSightingIs) {
  const auto measurement = TypeParam::Measure(kSighting, {});
  const TypeParam landmark = TypeParam::Initial(kPose, measurement);
  EXPECT_LT((landmark.p_map() - kPose * kSighting.p_robot).norm(), 1e-12);
  EXPECT_NEAR(AngleDiff(landmark.slope(), kPose.theta + kSighting.slope), 0.0, 1e-9);
  landmark.ForEachInnovation(kPose, measurement, [](const auto& innovation) {
    EXPECT_LT(innovation.v.norm(), 1e-12);
    EXPECT_GT(innovation.S_known_pose.determinant(), 0.0);
  });
}

TYPED_TEST(LandmarkModels, AnInnovationsJacobianIsTheDerivativeByThePose) {
  const auto measurement = TypeParam::Measure(kSighting, {});
  const TypeParam landmark = TypeParam::Initial({0.5, -1.0, 0.65}, measurement);
  const auto gate = [&](const Eigen::Vector3d& x) -> Eigen::Matrix<double, TypeParam::kGateNumbers, 1> {
    return -landmark.GateInnovation({x.x(), x.y(), x.z()}, measurement).v;
  };
  const auto J = NumericalDerivative<TypeParam::kGateNumbers, 3>(gate, kPose.vector());
  EXPECT_LT((landmark.GateInnovation(kPose, measurement).J_z_pose - J).cwiseAbs().maxCoeff(), 1e-6);
}

TYPED_TEST(LandmarkModels, TurningAndMovingTheWorldChangesNothingButTheFrame) {
  const Pose2 T_other_map{3.0, -2.0, 2.1};
  const auto first = TypeParam::Measure(kSighting, {});
  LandmarkSighting again = kSighting;
  again.p_robot += Eigen::Vector2d(0.1, -0.05);
  again.slope += 0.04;
  const auto second = TypeParam::Measure(again, {});
  TypeParam here = TypeParam::Initial(kPose, first), there = TypeParam::Initial(T_other_map * kPose, first);
  here.Learn(kPose, second);
  there.Learn(T_other_map * kPose, second);
  EXPECT_LT((T_other_map * Eigen::Vector2d(here.p_map()) - there.p_map()).norm(), 1e-9);
  EXPECT_NEAR(AngleDiff(there.slope(), here.slope()), T_other_map.theta, 1e-9);
}

TYPED_TEST(LandmarkModels, ManySightingsComeTogetherAndTheErrorIsNoLargerThanClaimed) {
  std::mt19937_64 rng(5);
  std::normal_distribution<double> normal;
  const LandmarkNoise noise;
  const Eigen::Vector2d truth = kPose * kSighting.p_robot;
  double nees = 0.0;
  constexpr int kRuns = 400, kSightings = 10;
  for (int run = 0; run < kRuns; ++run) {
    TypeParam landmark{};
    for (int i = 0; i < kSightings; ++i) {
      Eigen::Vector2d z = MeasureRangeBearing(kSighting.p_robot);
      z += Eigen::Vector2d(noise.range_m * normal(rng), noise.bearing_rad * normal(rng));
      LandmarkSighting seen = kSighting;
      seen.p_robot = z.x() * Eigen::Vector2d(std::cos(z.y()), std::sin(z.y()));
      seen.slope += noise.slope_rad * normal(rng);
      const auto measurement = TypeParam::Measure(seen, noise);
      if (i == 0) {
        landmark = TypeParam::Initial(kPose, measurement);
      } else {
        landmark.Learn(kPose, measurement);
      }
    }
    const Eigen::Vector2d error = landmark.p_map() - truth;
    nees += error.dot(landmark.covariance().inverse() * error) / kRuns;
  }
  // Two numbers: 2 on average, 1 where the noise is doubled on purpose. 95 % bounds over 400 runs: 2 +- 0.2.
  const bool doubled = std::is_same_v<TypeParam, LandmarkPair>;
  EXPECT_NEAR(nees, doubled ? 1.0 : 2.0, doubled ? 0.12 : 0.22);
}

TEST(PredictOriented, JacobiansAreTheDerivatives) {
  const Eigen::Vector3d landmark(3.1, 2.2, -2.0);
  const OrientedPrediction predicted = PredictOriented(kPose, landmark);
  const auto by_pose = NumericalDerivative<3, 3>(
      [&](const Eigen::Vector3d& x) -> Eigen::Vector3d {
        return PredictOriented({x.x(), x.y(), x.z()}, landmark).z;
      },
      kPose.vector());
  const auto by_landmark = NumericalDerivative<3, 3>(
      [&](const Eigen::Vector3d& l) -> Eigen::Vector3d { return PredictOriented(kPose, l).z; }, landmark);
  EXPECT_LT((predicted.J_z_pose - by_pose).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((predicted.J_z_landmark - by_landmark).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_EQ(predicted.J_z_landmark(1, 2), 0.0) << "(4-25) prints 1: the bearing does not depend on the angle";
}

TEST(LandmarkPair, TheExtensionIsAMetreAlongTheSlope) {
  const LandmarkPair landmark = LandmarkPair::Initial(kPose, LandmarkPair::Measure(kSighting, {}));
  EXPECT_LT((landmark.extension.mean - kPose * kSighting.extension_robot()).norm(), 1e-12);
}

TEST(LandmarkModels, TwoPositionsAndAnOrientationTellTheHeading) {
  // After a turn about the landmark the range is the same; only the slope shows the turn.
  const auto pair_measured = LandmarkPair::Measure(kSighting, {});
  const auto oriented_measured = LandmarkOriented::Measure(kSighting, {});
  const auto point_measured = LandmarkPoint::Measure(kSighting, {});
  const Pose2 T_map_landmark{kSighting.p_robot.x(), kSighting.p_robot.y(), 0.0};
  const Pose2 turned = T_map_landmark * Pose2{0, 0, 0.3} * T_map_landmark.Inverse();
  double pair = 0.0, point = 0.0;
  LandmarkPair::Initial({}, pair_measured).ForEachInnovation(turned, pair_measured, [&](const Innovation<2>& i) {
    pair += Nis<2>(i.v, i.S_known_pose);
  });
  LandmarkPoint::Initial({}, point_measured).ForEachInnovation(turned, point_measured, [&](const Innovation<2>& i) {
    point += Nis<2>(i.v, i.S_known_pose);
  });
  const auto oriented = LandmarkOriented::Initial({}, oriented_measured).GateInnovation(turned, oriented_measured);
  EXPECT_GT(pair, 1.0);
  EXPECT_GT(Nis<3>(oriented.v, oriented.S_known_pose), 10.0);
  EXPECT_LT(point, 1e-9);
}

}  // namespace
}  // namespace cairn::slam
