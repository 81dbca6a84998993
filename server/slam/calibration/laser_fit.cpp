#include "server/slam/calibration/laser_fit.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace cairn::slam {
namespace {

constexpr int kRounds = 3;  // Of mounting and turn. After the second one the values change by less than their doubt.

double MedianPeriod(const LaserLog& log) {
  std::vector<double> periods;
  for (std::size_t i = 1; i < log.scans.size(); ++i)
    periods.push_back(SecondsFromStamp(log.scans[i]->stamp - log.scans[i - 1]->stamp));
  if (periods.empty()) return 0.0;
  const auto middle = periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2);
  std::nth_element(periods.begin(), middle, periods.end());
  return *middle;
}

// Time from the first beam to the last.
double DurationOf(const Scan& scan, const LidarTiming& timing) {
  Scan timed = scan;
  if (!PutInOrderOfTime(timing, timed)) return 0.0;
  return timed.beam_period_s * (static_cast<double>(timed.ranges_m.size()) - 1.0);
}

// The place of the stamp within a scan for which the lag is smallest; the middle among equals.
void SayStampPlace(const Scan& scan, double lag_of_middle_s, LaserFit& fit) {
  fit.lag_s = lag_of_middle_s;
  if (fit.timing.scan_period_s.value_or(0.0) <= 0.0) return;
  const double half_s = 0.5 * DurationOf(scan, fit.timing);
  for (const auto& [place, lag_s] :
       {std::pair{StampAt::kFirst, lag_of_middle_s + half_s}, std::pair{StampAt::kLast, lag_of_middle_s - half_s}}) {
    if (std::abs(lag_s) >= std::abs(fit.lag_s)) continue;
    fit.lag_s = lag_s;
    fit.timing.stamp_at = place;
  }
}

}  // namespace

Result<LaserFit> FitLaser(const LaserLog& log, const LaserFitOptions& options, const ParallelFor& parallel_for) {
  LaserFit fit;
  fit.scan_period_s = MedianPeriod(log);
  LaserGuess guess;
  if (!log.scans.empty()) guess.T_robot_laser = log.scans.front()->T_robot_laser;
  guess.timing.scan_period_s = 0.0;
  const OdometryPath logged(log.odometry, {});
  const auto along = PairsAlongTheWay(log, logged, static_cast<std::size_t>(options.pairs_along));
  const auto turning = PairsOfUnequalTurns(log, logged, static_cast<std::size_t>(options.pairs_turning));
  for (int round = 0; round < kRounds; ++round) {
    const OdometryPath odometry(log.odometry, guess.wheels);
    fit.mounting = FitMounting(log.odometry, AlignPairs(log, odometry, along, guess, parallel_for), guess,
                               options.widest_lag_s, options.seed);
    if (fit.mounting.pairs < 10)
      return Fail(StatusCode::kFailedPrecondition,
                  "only " + std::to_string(fit.mounting.pairs) +
                      " pairs of scans could be aligned, at least 10 are needed: does the robot move?");
    guess.lag_s = fit.mounting.lag_s;
    guess.wheels = fit.mounting.wheels;
    guess.T_robot_laser = fit.mounting.T_robot_laser;
    if (round + 1 == kRounds) break;
    fit.turn = FitTurn(log, OdometryPath(log.odometry, guess.wheels), turning, guess, fit.scan_period_s, options.seed,
                       parallel_for);
    guess.timing = fit.turn.timing;
    if (!fit.turn.shown()) guess.timing.scan_period_s = 0.0;
  }
  fit.timing = guess.timing;
  SayStampPlace(*log.scans.front(), fit.mounting.lag_s, fit);
  return fit;
}

}  // namespace cairn::slam
