#include "server/slam/calibration/scan_matching_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/slam/calibration/spread_fit.h"

namespace cairn::slam {
namespace {

constexpr int kMaxRounds = 200;
constexpr double kLeastSigma = 1e-5;
// The error of a failed match is uniformly distributed within 1 m, 1 m and 0.5 rad to either side.
constexpr double kFailureDensity = 1.0 / (2.0 * 2.0 * 1.0);
constexpr double kFirstFailureShare = 0.05;
constexpr double kLeastFailureShare = 1e-6;

double NormalDensity(double x, double sigma) {
  return std::exp(-0.5 * x * x / (sigma * sigma)) / (sigma * std::sqrt(2 * kPi));
}

MatchSpread FitSpread(std::span<const SpreadSample> samples, const MatchSpread& start) {
  const Eigen::Vector2d s = FitSigma(samples, {start.base, start.share}, kLeastSigma);
  return {s.x(), s.y()};
}

double Change(const ScanMatchingModel& a, const ScanMatchingModel& b) {
  const auto of = [](const MatchSpread& s, const MatchSpread& t) {
    return std::abs(s.base - t.base) + std::abs(s.share - t.share);
  };
  return of(a.along, b.along) + of(a.across, b.across) + of(a.turn, b.turn) +
         std::abs(a.shortfall_share - b.shortfall_share);
}

}  // namespace

ScanMatchingFit FitScanMatching(std::span<const MatchSample> samples, const ScanMatchingModel& start) {
  ScanMatchingFit fit{start, static_cast<int>(samples.size())};
  if (samples.empty()) return fit;
  fit.failure_share = kFirstFailureShare;
  ScanMatchingModel& model = fit.model;
  std::vector<SpreadSample> along, across, turn;
  for (const MatchSample& s : samples) {
    const double dx = s.truth.x - s.reported.x, dy = s.truth.y - s.reported.y;
    const double dtheta = AngleDiff(s.truth.theta, s.reported.theta);
    along.push_back({1.0, std::abs(s.reported.x), dx * dx, 1.0});
    across.push_back({1.0, std::abs(s.reported.y), dy * dy, 1.0});
    turn.push_back({1.0, std::abs(s.reported.theta), dtheta * dtheta, 1.0});
  }
  for (; fit.iterations < kMaxRounds; ++fit.iterations) {
    double missed = 0.0, failed = 0.0, possible = 0.0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const MatchSample& s = samples[i];
      const double error = s.truth.x - s.reported.x;
      const double rest = NormalDensity(std::sqrt(across[i].square), model.across.Sigma(s.reported.y)) *
                          NormalDensity(std::sqrt(turn[i].square), model.turn.Sigma(s.reported.theta));
      const bool may = MayFallShort(model, s.reported, s.lambda_m);
      const double share = may ? model.shortfall_share : 0.0;
      const double good = (1 - fit.failure_share) * rest;
      const double whole = good * (1 - share) * NormalDensity(error, model.along.Sigma(s.reported.x));
      const double lack = may ? good * share * NormalDensity(error - s.lambda_m, s.lambda_m / 2) : 0.0;
      const double sum = whole + lack + fit.failure_share * kFailureDensity;
      along[i].weight = whole / sum;
      across[i].weight = turn[i].weight = (whole + lack) / sum;
      missed += lack / sum;
      possible += may ? (whole + lack) / sum : 0.0;
      failed += 1 - (whole + lack) / sum;
    }
    const ScanMatchingModel before = model;
    const double failures_before = fit.failure_share;
    model.along = FitSpread(along, before.along);
    model.across = FitSpread(across, before.across);
    model.turn = FitSpread(turn, before.turn);
    if (possible > 0.0) model.shortfall_share = std::clamp(missed / possible, 0.0, 1.0);
    fit.failure_share = std::clamp(failed / static_cast<double>(samples.size()), kLeastFailureShare, 1.0);
    if (Change(model, before) + std::abs(fit.failure_share - failures_before) < 1e-7) break;
  }
  return fit;
}

}  // namespace cairn::slam
