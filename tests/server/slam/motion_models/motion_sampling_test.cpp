#include "server/slam/motion_models/motion_sampling.h"

#include <gtest/gtest.h>

#include <cmath>

namespace cairn::slam {
namespace {

class SampledModels : public testing::TestWithParam<MotionModel> {};
INSTANTIATE_TEST_SUITE_P(Both, SampledModels, testing::Values(MotionModel::kVelocity, MotionModel::kOdometry));

TEST_P(SampledModels, MeanIsTheStepAndTheSpreadIsTheAlphas) {
  MotionSampling options;
  options.model = GetParam();
  options.alpha_v_v = 0.01;  // A standard deviation of 0.1 m per metre.
  options.alpha_w_v = options.alpha_g_v = 0.0004;
  std::mt19937_64 rng(3);
  const Pose2 step{1.0, 0.0, 0.0};
  constexpr int kDraws = 20000;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::Vector3d d = Between(step, SampleMotion({}, {step}, options, rng)).vector();
    mean += d / kDraws;
    squares += d.cwiseAbs2() / kDraws;
  }
  EXPECT_LT(mean.norm(), 0.005);
  EXPECT_NEAR(std::sqrt(squares.x()), 0.1, 0.003);
  EXPECT_NEAR(std::sqrt(squares.z()), std::sqrt(2 * 0.0004), 0.001);  // Two turns, independent.
}

TEST_P(SampledModels, WithoutNoiseEverySampleIsTheStep) {
  MotionSampling options{GetParam(), 0, 0, 0, 0, 0, 0, {}};
  std::mt19937_64 rng(3);
  const Pose2 end = SampleMotion({1, 2, 0.5}, {{0.3, -0.1, 0.4}}, options, rng);
  EXPECT_LT(Between(end, Pose2{1, 2, 0.5} * Pose2{0.3, -0.1, 0.4}).vector().norm(), 1e-9);
}

struct Moments {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma = Eigen::Vector3d::Zero();
};

// The order is D, C, B.
Moments MomentsOf(const MotionSampling& options, const StepMotion& step) {
  std::mt19937_64 rng(5);
  constexpr int kDraws = 40000;
  const StepMotion input = InputOf(options.model, step);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::Vector3d terms = TermsOf(SampleMotion({}, input, options, rng));
    mean += terms / kDraws;
    squares += terms.cwiseAbs2() / kDraws;
  }
  return {mean, (squares - mean.cwiseAbs2()).cwiseSqrt()};
}

TEST(SampledEliazar, TakesTheStepOfTheOdometry) {
  MotionSampling options{MotionModel::kEliazar};
  options.learnt.eliazar.along = {0.9, 0.1, 0.05, 0.0, 0.002};
  options.learnt.eliazar.across = {0.02, 0.0, 0.0, 0.04, 0.002};
  options.learnt.eliazar.turn = {0.0, 1.1, 0.03, 0.0, 0.002};
  const OdometryStep odometry{0.5, 0.3};
  StepMotion step{{0.8, 0.1, -0.2}, 0.01 * Eigen::Matrix3d::Identity(), MotionOf({odometry.d, 0.0, odometry.b})};
  const auto expect = [&](const OdometryStep& taken) {
    const Moments moments = MomentsOf(options, step);
    for (int k = 0; k < kMotionTerms; ++k) {
      const MotionTermModel& term = options.learnt.eliazar.term(k);
      EXPECT_NEAR(moments.mean(k), term.Mean(taken.d, taken.b), 0.001) << k;
      EXPECT_NEAR(moments.sigma(k), std::sqrt(term.Variance(taken.d, taken.b)), 0.0005) << k;
    }
  };
  expect(odometry);
  EXPECT_TRUE(InputOf(options.model, step).covariance_prev.isZero()) << "that is the match's";
  // Without odometry the front-end's step is used, with its whole uncertainty.
  step.T_prev_curr_odom.reset();
  expect(StepOf(step.T_prev_curr));
  EXPECT_EQ(InputOf(options.model, step).covariance_prev, step.covariance_prev);
}

TEST(SampledScanMatching, TakesTheStepOfTheFrontEndAndTheWayItMayHaveMissed) {
  MotionSampling options{MotionModel::kScanMatching};
  options.learnt.scan_matching.shortfall_share = 0.25;
  StepMotion step{{0.3, 0.0, 0.0}, Eigen::Matrix3d::Zero(), Pose2{5.0, 0.0, 1.0}};
  EXPECT_NEAR(MomentsOf(options, step).mean.x(), 0.3, 0.002);
  EXPECT_NEAR(MomentsOf(options, step).sigma.z(), options.learnt.scan_matching.turn.base, 0.0005);
  step.lambda_m = 0.4;
  EXPECT_NEAR(MomentsOf(options, step).mean.x(), 0.3 + 0.25 * 0.4, 0.005);
}

}  // namespace
}  // namespace cairn::slam
