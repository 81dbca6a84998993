#include "server/slam/calibration/scan_matching_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace cairn::slam {
namespace {

std::vector<MatchSample> Draw(const ScanMatchingModel& model, int count, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<MatchSample> samples;
  for (int i = 0; i < count; ++i) {
    const Pose2 reported{0.3 + 0.3 * uniform(engine), 0.1 * uniform(engine), 0.3 * uniform(engine)};
    const double lambda = 0.25;
    samples.push_back({reported, SampleMotion(model, reported, lambda, engine), lambda});
  }
  return samples;
}

// Table 5.1 with its numbers: 2 cm + 10 %, half a degree + 10 %.
TEST(ScanMatchingModel, SamplesSpreadAsTheTableSays) {
  ScanMatchingModel model;
  model.shortfall_share = 0.0;
  std::mt19937_64 engine(3);
  const Pose2 reported{0.4, 0.05, 0.2};
  const int n = 20000;
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  for (int i = 0; i < n; ++i) {
    const Pose2 truth = SampleMotion(model, reported, 0.3, engine);
    squares += Eigen::Vector3d(truth.x - 0.4, truth.y - 0.05, truth.theta - 0.2).cwiseAbs2() / n;
  }
  EXPECT_NEAR(std::sqrt(squares(0)), 0.06, 0.0015);
  EXPECT_NEAR(std::sqrt(squares(1)), 0.025, 0.0007) << "v, not v/3 as Table 5.2 would give";
  EXPECT_NEAR(std::sqrt(squares(2)), Radians(0.5) + 0.02, 0.001);
}

TEST(ScanMatchingModel, FallsShortOnlyWithoutTurning) {
  ScanMatchingModel model;
  model.along = {0.001, 0.0};
  std::mt19937_64 engine(4);
  const auto share = [&](double turn, double lambda) {
    int missed = 0;
    for (int i = 0; i < 10000; ++i) missed += SampleMotion(model, {0.0, 0.0, turn}, lambda, engine).x > 0.01;
    return missed / 10000.0;
  };
  EXPECT_NEAR(share(0.0, 0.2), 0.05 * 0.97, 0.01);  // 2.6 % of the shortfalls draw below 0.01 m.
  EXPECT_EQ(share(Radians(5.0), 0.2), 0.0);
  EXPECT_EQ(share(-Radians(5.0), 0.2), 0.0) << "the sign of the turn does not matter";
  EXPECT_EQ(share(0.0, 0.0), 0.0);
}

TEST(ScanMatchingFit, RecoversInjectedSigmas) {
  ScanMatchingModel truth;
  truth.along = {0.015, 0.06};
  truth.across = {0.01, 0.15};
  truth.turn = {0.006, 0.05};
  truth.shortfall_share = 0.08;
  const ScanMatchingFit fit = FitScanMatching(Draw(truth, 8000, 7), {});
  EXPECT_EQ(fit.samples, 8000);
  EXPECT_NEAR(fit.model.along.base, 0.015, 0.002);
  EXPECT_NEAR(fit.model.along.share, 0.06, 0.008);
  EXPECT_NEAR(fit.model.across.base, 0.01, 0.001);
  EXPECT_NEAR(fit.model.across.share, 0.15, 0.02);
  EXPECT_NEAR(fit.model.turn.base, 0.006, 0.0005);
  EXPECT_NEAR(fit.model.turn.share, 0.05, 0.005);
  EXPECT_NEAR(fit.model.shortfall_share, 0.08, 0.02);
}

// One match in ten is plainly wrong. The spreads of the others must not change.
TEST(ScanMatchingFit, FailuresAreToldApart) {
  const ScanMatchingModel truth;
  std::vector<MatchSample> samples = Draw(truth, 4000, 9);
  std::mt19937_64 engine(10);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (std::size_t i = 0; i < samples.size(); i += 10) {
    samples[i].truth.x += uniform(engine);
    samples[i].truth.y += uniform(engine);
    samples[i].truth.theta += 0.5 * uniform(engine);
  }
  const ScanMatchingFit fit = FitScanMatching(samples, {});
  EXPECT_NEAR(fit.failure_share, 0.1, 0.025);
  EXPECT_NEAR(fit.model.across.base, truth.across.base, 0.003);
  EXPECT_NEAR(fit.model.turn.base, truth.turn.base, 0.002);
}

TEST(ScanMatchingFit, NoShortfallsAreFoundWhereThereAreNone) {
  ScanMatchingModel truth;
  truth.shortfall_share = 0.0;
  EXPECT_LT(FitScanMatching(Draw(truth, 4000, 8), {}).model.shortfall_share, 0.01);
}

TEST(ScanMatchingFit, DegenerateInputIsHarmless) {
  EXPECT_EQ(FitScanMatching({}, {}).model.along.base, ScanMatchingModel{}.along.base);
  const std::vector<MatchSample> perfect(10);
  const ScanMatchingModel model = FitScanMatching(perfect, {}).model;
  EXPECT_TRUE(std::isfinite(model.along.base));
  EXPECT_LT(model.turn.base, 1e-3);
}

}  // namespace
}  // namespace cairn::slam
