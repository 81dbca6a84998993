#include "server/slam/motion/velocity_model.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

TEST(InverseVelocity, UndoesApplyVelocityInEveryDirectionOfTravel) {
  const Pose2 start{1.0, -2.0, 0.8};
  for (double course = -3.1; course < 3.1; course += 0.3) {
    for (const double length : {0.0, 1e-12, 0.5}) {
      const Pose2 step{length * std::cos(course), length * std::sin(course), 0.3};
      const Pose2 end = ApplyVelocity(start, InverseVelocity(step)), expected = start * step;
      EXPECT_NEAR(end.x, expected.x, 1e-9);
      EXPECT_NEAR(end.y, expected.y, 1e-9);
      EXPECT_NEAR(AngleDiff(end.theta, expected.theta), 0.0, 1e-9);
    }
  }
}

TEST(ApplyVelocity, AQuarterCircle) {
  const Pose2 end = ApplyVelocity({}, {kPi, kPi / 2, 0.0});  // Radius 2.
  EXPECT_NEAR(end.x, 2.0, 1e-12);
  EXPECT_NEAR(end.y, 2.0, 1e-12);
  EXPECT_NEAR(end.theta, kPi / 2, 1e-12);
}

TEST(InverseVelocity, DrivingBackwardsIsNegativeSpeed) {
  const VelocityControl control = InverseVelocity({-0.5, 0.0, 0.0});
  EXPECT_NEAR(control.v, -0.5, 1e-12);
  EXPECT_NEAR(control.w, 0.0, 1e-12);
  EXPECT_NEAR(control.g, 0.0, 1e-12);
}

class SampledModels : public testing::TestWithParam<MotionModel> {};
INSTANTIATE_TEST_SUITE_P(Both, SampledModels, testing::Values(MotionModel::kVelocity, MotionModel::kOdometry));

TEST_P(SampledModels, MeanIsTheStepAndTheSpreadIsTheAlphas) {
  MotionSampling options;
  options.model = GetParam();
  options.alpha_v_v = 0.01;  // 0.1 m a metre.
  options.alpha_w_v = options.alpha_g_v = 0.0004;
  std::mt19937_64 rng(3);
  const Pose2 step{1.0, 0.0, 0.0};
  constexpr int kDraws = 20000;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::Vector3d d = Between(step, SampleMotion({}, step, options, rng)).vector();
    mean += d / kDraws;
    squares += d.cwiseAbs2() / kDraws;
  }
  EXPECT_LT(mean.norm(), 0.005);
  EXPECT_NEAR(std::sqrt(squares.x()), 0.1, 0.003);
  EXPECT_NEAR(std::sqrt(squares.z()), std::sqrt(2 * 0.0004), 0.001);  // Two turns, independent.
}

TEST_P(SampledModels, WithoutNoiseEverySampleIsTheStep) {
  MotionSampling options{GetParam(), 0, 0, 0, 0, 0, 0};
  std::mt19937_64 rng(3);
  const Pose2 end = SampleMotion({1, 2, 0.5}, {0.3, -0.1, 0.4}, options, rng);
  EXPECT_LT(Between(end, Pose2{1, 2, 0.5} * Pose2{0.3, -0.1, 0.4}).vector().norm(), 1e-9);
}

}  // namespace
}  // namespace cairn::slam
