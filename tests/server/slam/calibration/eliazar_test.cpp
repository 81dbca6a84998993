#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "server/slam/calibration/eliazar_fit.h"
#include "server/slam/calibration/spread_fit.h"
#include "server/slam/motion_models/eliazar_model.h"

namespace cairn::slam {
namespace {

EliazarModel Injected() {
  EliazarModel model;
  model.along = {0.97, 0.03, 0.10, 0.04, 0.001};
  model.across = {0.02, -0.03, 0.06, 0.03, 0.001};
  model.turn = {0.08, 1.05, 0.08, 0.15, 0.001};
  return model;
}

// Motions forwards and backwards, with and without turns.
std::vector<OdometryStep> Drives(int count, std::mt19937_64& engine) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<OdometryStep> steps;
  for (int i = 0; i < count; ++i) {
    const bool turning = i % 3 == 0;
    steps.push_back({turning ? 0.06 * uniform(engine) : 0.25 + 0.1 * uniform(engine),
                     turning ? 0.4 * uniform(engine) : 0.05 * uniform(engine)});
  }
  return steps;
}

void ExpectClose(const EliazarModel& fit, const EliazarModel& truth, double mean_bound, double sigma_bound) {
  for (int k = 0; k < kMotionTerms; ++k) {
    EXPECT_NEAR(fit.term(k).mean_d, truth.term(k).mean_d, mean_bound) << "term " << k;
    EXPECT_NEAR(fit.term(k).mean_b, truth.term(k).mean_b, mean_bound) << "term " << k;
    EXPECT_NEAR(fit.term(k).sigma_d, truth.term(k).sigma_d, sigma_bound) << "term " << k;
    EXPECT_NEAR(fit.term(k).sigma_b, truth.term(k).sigma_b, sigma_bound) << "term " << k;
  }
}

TEST(EliazarModel, TermsAndMotionAreInverse) {
  for (const Pose2& motion : {Pose2{0.3, 0.1, 0.4}, Pose2{-0.2, 0.05, -1.3}, Pose2{0, 0, 3.0}, Pose2{}}) {
    const Pose2 back = MotionOf(TermsOf(motion));
    EXPECT_NEAR(back.x, motion.x, 1e-15);
    EXPECT_NEAR(back.y, motion.y, 1e-15);
    EXPECT_NEAR(back.theta, motion.theta, 1e-15);
  }
}

// (4.46) as it is printed, for a robot that stands at (1, 2, 0.7).
TEST(EliazarModel, MovesAsTheEquationSays) {
  const Pose2 T_map_robot{1.0, 2.0, 0.7};
  const double D = 0.3, C = 0.05, B = 0.4;
  const Pose2 after = T_map_robot * MotionOf({D, C, B});
  EXPECT_NEAR(after.x, 1.0 + D * std::cos(0.7 + B / 2) + C * std::cos(0.7 + (B + kPi) / 2), 1e-15);
  EXPECT_NEAR(after.y, 2.0 + D * std::sin(0.7 + B / 2) + C * std::sin(0.7 + (B + kPi) / 2), 1e-15);
  EXPECT_NEAR(after.theta, 0.7 + B, 1e-15);
}

TEST(EliazarModel, OdometryStepsKnowBackwards) {
  const OdometryStep step = StepOf({-0.3, 0.0, 0.0});
  EXPECT_NEAR(step.d, -0.3, 1e-15);
  EXPECT_NEAR(step.b, 0.0, 1e-15);
}

TEST(EliazarModel, SamplesHaveTheStatedMomentsAndDensity) {
  const EliazarModel model = Injected();
  const OdometryStep step{0.3, 0.2};
  std::mt19937_64 engine(5);
  const int n = 40000;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
  double log_density = 0.0, entropy = 0.0;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d terms = TermsOf(SampleMotion(model, step, engine));
    sum += terms;
    squares += terms.cwiseAbs2();
    log_density += LogDensity(model, step, terms) / n;
  }
  for (int k = 0; k < kMotionTerms; ++k) {
    const double mean = model.term(k).Mean(0.3, 0.2), sigma = std::sqrt(model.term(k).Variance(0.3, 0.2));
    EXPECT_NEAR(sum(k) / n, mean, 4 * sigma / std::sqrt(n));
    EXPECT_NEAR(std::sqrt(squares(k) / n - sum(k) * sum(k) / n / n), sigma, 0.02 * sigma);
    entropy += 0.5 * std::log(2 * kPi * std::exp(1.0) * sigma * sigma);
  }
  EXPECT_NEAR(log_density, -entropy, 0.03) << "the mean log density of a sampler's own draws is minus its entropy";
}

TEST(SpreadFit, RecoversVariancesAndSigmas) {
  std::mt19937_64 engine(2);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<SpreadSample> variances, sigmas;
  for (int i = 0; i < 20000; ++i) {
    const double a = uniform(engine), b = uniform(engine), e = normal(engine);
    variances.push_back({a, b, (0.04 * a + 0.09 * b + 0.001) * e * e, 1.0});
    sigmas.push_back({1.0, b, std::pow((0.02 + 0.1 * b) * e, 2), 1.0});
  }
  const Eigen::Vector2d v = FitVariance(variances, {1.0, 1.0}, 0.001, 1e-9);
  EXPECT_NEAR(v(0), 0.04, 0.003);
  EXPECT_NEAR(v(1), 0.09, 0.004);
  const Eigen::Vector2d s = FitSigma(sigmas, {1.0, 1.0}, 1e-9);
  EXPECT_NEAR(s(0), 0.02, 0.001);
  EXPECT_NEAR(s(1), 0.1, 0.003);
}

TEST(SpreadFit, AnAbsentSpreadStopsAtTheBound) {
  std::mt19937_64 engine(2);
  std::normal_distribution<double> normal;
  std::vector<SpreadSample> samples;
  for (int i = 0; i < 2000; ++i) samples.push_back({1.0, i % 10 * 0.1, std::pow(0.05 * normal(engine), 2), 1.0});
  const Eigen::Vector2d s = FitSigma(samples, {0.1, 0.1}, 1e-5);
  EXPECT_NEAR(s(0), 0.05, 0.004);
  EXPECT_LT(s(1), 0.01);
  EXPECT_EQ(FitSigma({}, {0.1, 0.2}, 1e-5), Eigen::Vector2d(0.1, 0.2)) << "no samples, no change";
}

TEST(EliazarFit, PerfectMeasurementsRecoverTheModel) {
  std::mt19937_64 engine(11);
  const EliazarModel truth = Injected();
  std::vector<StepMoments> moments;
  for (const OdometryStep& step : Drives(6000, engine)) {
    const Eigen::Vector3d terms = TermsOf(SampleMotion(truth, step, engine));
    moments.push_back({step, terms, terms.cwiseAbs2()});
  }
  EliazarModel fit;
  for (int k = 0; k < kMotionTerms; ++k) {
    fit.term(k).floor = 0.001;
    fit.term(k) = FitTerm(moments, k, fit.term(k));
  }
  ExpectClose(fit, truth, 0.02, 0.006);
}

// The errors of the matches are as large as those of the robot. Only the robot's share must be learnt.
TEST(EliazarFit, TheMatchersErrorIsNotTakenForTheRobots) {
  std::mt19937_64 engine(12);
  const EliazarModel truth = Injected();
  std::normal_distribution<double> normal;
  std::vector<MeasuredStep> steps;
  const Eigen::Vector3d sigma(0.02, 0.02, 0.02);
  for (const OdometryStep& step : Drives(3000, engine)) {
    const Pose2 motion = SampleMotion(truth, step, engine);
    steps.push_back({step,
                     {motion.x + sigma(0) * normal(engine), motion.y + sigma(1) * normal(engine),
                      motion.theta + sigma(2) * normal(engine)},
                     sigma.cwiseAbs2().asDiagonal()});
  }
  EliazarModel start;
  for (int k = 0; k < kMotionTerms; ++k) start.term(k).floor = 0.001;
  EliazarFitOptions options;
  options.max_iterations = 200;
  const EliazarFit fit = FitEliazar(steps, start, options, SerialFor);
  EXPECT_TRUE(fit.converged);
  EXPECT_GT(fit.effective_share, 0.2);
  ExpectClose(fit.model, truth, 0.05, 0.025);
  // Without the deconvolution every match is taken as exact.
  std::vector<MeasuredStep> believed = steps;
  for (MeasuredStep& step : believed) step.covariance *= 1e-4;
  const EliazarFit naive = FitEliazar(believed, start, options, SerialFor);
  EXPECT_GT(naive.model.across.sigma_d, truth.across.sigma_d + 0.02);
}

TEST(EliazarFit, LikelihoodDoesNotFallAndThreadsDoNotMatter) {
  std::mt19937_64 engine(13);
  const EliazarModel truth = Injected();
  std::vector<MeasuredStep> steps;
  for (const OdometryStep& step : Drives(400, engine))
    steps.push_back({step, SampleMotion(truth, step, engine), Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal()});
  const auto run = [&](int iterations, const ParallelFor& parallel_for) {
    EliazarFitOptions options;
    options.max_iterations = iterations;
    options.stop_change = 0.0;
    return FitEliazar(steps, {}, options, parallel_for);
  };
  double last = run(1, SerialFor).log_likelihood;
  for (const int iterations : {2, 4, 8, 16}) {
    const double now = run(iterations, SerialFor).log_likelihood;
    EXPECT_GT(now, last - 0.02) << "up to the noise of the particles";
    last = now;
  }
  const ParallelFor backwards = [](int count, const std::function<void(int, int)>& body) {
    for (int i = count - 1; i >= 0; --i) body(i, i + 1);
  };
  const EliazarFit a = run(3, SerialFor), b = run(3, backwards);
  for (int k = 0; k < kMotionTerms; ++k) {
    EXPECT_EQ(a.model.term(k).mean_d, b.model.term(k).mean_d);
    EXPECT_EQ(a.model.term(k).sigma_b, b.model.term(k).sigma_b);
  }
}

TEST(EliazarFit, DegenerateInputIsHarmless) {
  const EliazarFit none = FitEliazar({}, {}, {}, SerialFor);
  EXPECT_FALSE(none.converged);
  EXPECT_EQ(none.model.along.mean_d, EliazarModel{}.along.mean_d);
  // A robot that does not move: nothing can be learnt about d and b, and no value may become NaN.
  const std::vector<MeasuredStep> still(50, {{0, 0}, {}, Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal()});
  const EliazarFit fit = FitEliazar(still, {}, {}, SerialFor);
  for (int k = 0; k < kMotionTerms; ++k) {
    EXPECT_TRUE(std::isfinite(fit.model.term(k).mean_d));
    EXPECT_TRUE(std::isfinite(fit.model.term(k).sigma_b));
  }
  EXPECT_NEAR(fit.model.along.mean_d, 1.0, 1e-6) << "what was not seen stays";
}

}  // namespace
}  // namespace cairn::slam
