#include "server/slam/motion/scan_matching_model.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/slam/filters/resampling.h"

namespace cairn::slam {
namespace {

constexpr int kMaxRounds = 200;
constexpr double kLeastSigma = 1e-5;
// A failed match may say anything within 1 m, 1 m and 0.5 rad.
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

bool MayFallShort(const ScanMatchingModel& model, const Pose2& reported, double lambda_m) {
  return lambda_m > 0.0 && std::abs(reported.theta) < model.shortfall_max_turn_rad;
}

}  // namespace

double MatchSpread::Sigma(double reported) const {
  return base + share * std::abs(reported);
}

void Visit(OptionVisitor& visitor, ScanMatchingModel& model) {
  const auto spread = [&](std::string_view key, MatchSpread& axis, std::string_view unit) {
    visitor.Section(key, "Standard deviation of the matcher's error on this axis.", [&] {
      visitor.Real("base", axis.base, unit, 1e-6, 1.0, "Of a step at rest.");
      visitor.Real("share", axis.share, "1", 0.0, 2.0, "Of the reported motion.");
    });
  };
  spread("along", model.along, "m");
  spread("across", model.across, "m");
  spread("turn", model.turn, "rad");
  visitor.Real("shortfall_share", model.shortfall_share, "1", 0.0, 1.0, "How often the matcher misses the way.");
  visitor.Real("shortfall_max_turn_rad", model.shortfall_max_turn_rad, "rad", 0.0, 3.2,
               "Reported turns above it are never short.");
}

Pose2 SampleMotion(const ScanMatchingModel& model, const Pose2& T_prev_curr, double lambda_m, std::mt19937_64& engine) {
  // The same number of draws whatever comes of them.
  const bool is_short = UniformDraw(engine) < model.shortfall_share && MayFallShort(model, T_prev_curr, lambda_m);
  const double forward = NormalDraw(engine), sideways = NormalDraw(engine), turning = NormalDraw(engine);
  return {T_prev_curr.x + (is_short ? lambda_m + lambda_m / 2 * forward : model.along.Sigma(T_prev_curr.x) * forward),
          T_prev_curr.y + model.across.Sigma(T_prev_curr.y) * sideways,
          WrapAngle(T_prev_curr.theta + model.turn.Sigma(T_prev_curr.theta) * turning)};
}

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
