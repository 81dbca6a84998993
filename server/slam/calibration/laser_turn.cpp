#include "server/slam/calibration/laser_turn.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/slam/random/draws.h"

namespace cairn::slam {
namespace {

constexpr int kTurnResamples = 200;
constexpr double kTurn = 2.0 * kPi;

// Disagreement of each pair; not a number where it could not be aligned.
using Costs = std::vector<double>;

double Mean(const Costs& costs) {
  double sum = 0.0;
  int count = 0;
  for (const double cost : costs) {
    if (!std::isfinite(cost)) continue;
    sum += cost;
    ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
}

// By how many standard deviations of the mean the pairs agree better in `better`.
double SigmasBetween(const Costs& better, const Costs& worse) {
  double sum = 0.0, squares = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < better.size(); ++i) {
    const double difference = worse[i] - better[i];
    if (!std::isfinite(difference)) continue;
    sum += difference;
    squares += difference * difference;
    ++count;
  }
  if (count < 3) return 0.0;
  const double mean = sum / count, variance = squares / count - mean * mean;
  return variance > 0.0 ? mean / std::sqrt(variance / (count - 1)) : 0.0;
}

// Where a parabola through the least value and its neighbours has its minimum, in steps of the grid.
double LeastOf(const std::vector<double>& values) {
  const auto least = static_cast<std::size_t>(std::min_element(values.begin(), values.end()) - values.begin());
  const auto at = static_cast<double>(least);
  if (least == 0 || least + 1 == values.size()) return at;
  const double a = values[least - 1], b = values[least], c = values[least + 1];
  const double bend = a - 2.0 * b + c;
  return bend > 0.0 && std::isfinite(bend) ? at + std::clamp(0.5 * (a - c) / bend, -0.5, 0.5) : at;
}

struct LineMinimum {
  double at = 0.0;     // In steps of the grid.
  double doubt = 0.0;  // Standard deviation, in steps.
};

// costs[g]: those of every pair at one place of the grid.
LineMinimum MinimumOf(const std::vector<Costs>& costs, std::uint64_t seed) {
  std::vector<double> means;
  means.reserve(costs.size());
  for (const Costs& one : costs) means.push_back(Mean(one));
  LineMinimum minimum{LeastOf(means), 0.0};
  Rng rng(seed);
  double squares = 0.0;
  const std::size_t pairs = costs.front().size();
  for (int k = 0; k < kTurnResamples; ++k) {
    std::vector<double> sums(costs.size(), 0.0);
    for (std::size_t i = 0; i < pairs; ++i) {
      const auto drawn = static_cast<std::size_t>(UniformDraw(rng) * static_cast<double>(pairs));
      bool all = true;
      for (const Costs& one : costs) all = all && std::isfinite(one[drawn]);
      if (!all) continue;
      for (std::size_t g = 0; g < costs.size(); ++g) sums[g] += costs[g][drawn];
    }
    const double off = LeastOf(sums) - minimum.at;
    squares += off * off;
  }
  // The grid itself is no finer than this.
  minimum.doubt = std::max(std::sqrt(squares / kTurnResamples), 0.1);
  return minimum;
}

// Whether the turn may begin anywhere in the array: drivers leave out a beam or two, or repeat one.
bool GoesRound(const Scan& scan) {
  const double turn = kTurn / std::abs(scan.angle_step_rad);
  return std::abs(static_cast<double>(scan.ranges_m.size()) - turn) < 0.02 * turn;
}

class TurnSearch {
 public:
  TurnSearch(const LaserLog& log, const OdometryPath& odometry, std::span<const PairOfScans> pairs,
             const LaserGuess& guess, const ParallelFor& parallel_for)
      : log_(log), odometry_(odometry), pairs_(pairs), guess_(guess), parallel_for_(parallel_for) {}

  [[nodiscard]] Costs Of(const LidarTiming& timing) const {
    LaserGuess guess = guess_;
    guess.timing = timing;
    Costs costs;
    for (const AlignedPair& pair : AlignPairs(log_, odometry_, pairs_, guess, parallel_for_))
      costs.push_back(pair.found ? pair.disagreement : std::numeric_limits<double>::quiet_NaN());
    return costs;
  }

 private:
  const LaserLog& log_;
  const OdometryPath& odometry_;
  std::span<const PairOfScans> pairs_;
  const LaserGuess& guess_;
  const ParallelFor& parallel_for_;
};

}  // namespace

TurnFit FitTurn(const LaserLog& log, const OdometryPath& odometry, std::span<const PairOfScans> pairs,
                const LaserGuess& guess, double period_s, std::uint64_t seed, const ParallelFor& parallel_for) {
  TurnFit fit;
  fit.pairs = static_cast<int>(pairs.size());
  fit.timing.scan_period_s = 0.0;
  if (pairs.empty()) return fit;
  const Scan& example = *log.scans[pairs.front().first];
  const bool full_turn = GoesRound(example);
  const TurnSearch search(log, odometry, pairs, guess, parallel_for);
  const Costs at_once = search.Of(fit.timing);
  fit.rms_at_once_m = fit.rms_m = std::sqrt(Mean(at_once));

  // Which side, and roughly where the turn begins.
  constexpr int kBegins = 8;
  Costs best_of_side[2];
  LidarTiming best[2];
  for (const bool clockwise : {false, true}) {
    for (int k = 0; k < (full_turn ? kBegins : 1); ++k) {
      LidarTiming timing{period_s, StampAt::kMiddle, clockwise, std::nullopt};
      if (full_turn) timing.turn_from_rad = WrapAngle(example.angle_first_rad + k * kTurn / kBegins);
      Costs costs = search.Of(timing);
      if (best_of_side[clockwise].empty() || Mean(costs) < Mean(best_of_side[clockwise])) {
        best_of_side[clockwise] = std::move(costs);
        best[clockwise] = timing;
      }
    }
  }
  const bool clockwise = Mean(best_of_side[1]) < Mean(best_of_side[0]);
  LidarTiming timing = best[clockwise];

  if (full_turn) {  // Once coarsely, half way to the neighbours, and once more around what was found.
    for (const double step : {kTurn / 24.0, kTurn / 48.0}) {
      constexpr int kSteps = 3;
      std::vector<Costs> costs;
      for (int k = -kSteps; k <= kSteps; ++k) {
        LidarTiming other = timing;
        other.turn_from_rad = WrapAngle(*timing.turn_from_rad + k * step);
        costs.push_back(search.Of(other));
      }
      const LineMinimum least = MinimumOf(costs, seed);
      timing.turn_from_rad = WrapAngle(*timing.turn_from_rad + (least.at - kSteps) * step);
      fit.from_doubt_rad = least.doubt * step;
    }
  }
  constexpr int kPeriods = 9;
  constexpr double kFirstShare = 0.4, kShareStep = 0.1;
  std::vector<Costs> costs;
  for (int k = 0; k < kPeriods; ++k) {
    LidarTiming other = timing;
    other.scan_period_s = period_s * (kFirstShare + k * kShareStep);
    costs.push_back(search.Of(other));
  }
  const LineMinimum least = MinimumOf(costs, seed);
  timing.scan_period_s = period_s * std::min(1.0, kFirstShare + least.at * kShareStep);
  fit.period_doubt_s = period_s * kShareStep * least.doubt;

  const Costs final_costs = search.Of(timing);
  fit.sense_sigmas = SigmasBetween(final_costs, best_of_side[!clockwise]);
  fit.turning_sigmas = SigmasBetween(final_costs, at_once);
  if (Mean(final_costs) >= Mean(at_once)) return fit;
  fit.timing = timing;
  fit.rms_m = std::sqrt(Mean(final_costs));
  return fit;
}

}  // namespace cairn::slam
