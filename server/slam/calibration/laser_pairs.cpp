#include "server/slam/calibration/laser_pairs.h"

#include <algorithm>
#include <cmath>

#include "server/slam/matching/point_index.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/scan/deskew.h"

namespace cairn::slam {
namespace {

// Turns are measured over about the time of a scan.
constexpr double kRateWindow_s = 0.2;
// A pair along the way: this far apart, or this far turned, but not longer ago.
constexpr double kPairStep_m = 0.2, kPairStep_rad = 0.2, kLongestStep_s = 2.0;
// Two scans of unequal turns.
constexpr double kNear_m = 0.6, kNear_s = 5.0, kUnequal_rad_s = 0.2;
// Points farther from every surface count as this far.
constexpr double kFarthestPoint_m = 0.15;
// The prior of a free alignment: the scans decide.
constexpr double kFree_m = 0.3, kFree_rad = 0.3;

std::vector<PairOfScans> Thinned(const std::vector<PairOfScans>& pairs, std::size_t most) {
  if (pairs.size() <= most) return pairs;
  std::vector<PairOfScans> kept;
  for (std::size_t i = 0; i < most; ++i) kept.push_back(pairs[i * pairs.size() / most]);
  return kept;
}

double Disagreement(std::span<const SurfacePoint> points, const PointIndex& reference, const Pose2& T_ref_curr) {
  const Eigen::Matrix2d R = T_ref_curr.rotation();
  double sum = 0.0;
  std::size_t count = 0;
  for (const SurfacePoint& point : points) {
    if (!point.smooth()) continue;
    const Eigen::Vector2d p = T_ref_curr * point.p;
    const SurfacePoint* nearest = reference.Nearest(p, kFarthestPoint_m);
    double d = kFarthestPoint_m;
    if (nearest != nullptr && nearest->smooth() && nearest->normal.dot(R * point.normal) > 0.5)
      d = std::min(d, std::abs(nearest->normal.dot(p - nearest->p)));
    sum += d * d;
    ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : kFarthestPoint_m * kFarthestPoint_m;
}

}  // namespace

std::optional<ScanAtOnce> AtOnce(const Scan& scan, const LaserGuess& guess, const OdometryPath& odometry) {
  Scan timed = scan;
  timed.beam_period_s = 0.0;
  timed.T_robot_laser = guess.T_robot_laser;
  if (!PutInOrderOfTime(guess.timing, timed)) return std::nullopt;
  timed.stamp -= StampFromSeconds(guess.lag_s);
  const Stamp end = timed.stamp + static_cast<Stamp>(DurationNs(timed));
  const auto during = odometry.Covering(timed.stamp, end);
  if (during.empty()) return std::nullopt;
  if (timed.beam_period_s > 0.0) timed = Deskew(timed, during);
  if (!ValidateScan(timed)) return std::nullopt;
  timed.T_robot_laser = {};
  return ScanAtOnce{timed.stamp, SurfacePointsOf(PointsOf(timed), timed, {})};
}

std::vector<PairOfScans> PairsAlongTheWay(const LaserLog& log, const OdometryPath& odometry, std::size_t most) {
  std::vector<PairOfScans> pairs;
  std::optional<std::size_t> last;
  Pose2 T_odom_last;
  for (std::size_t i = 0; i < log.scans.size(); ++i) {
    const auto T_odom_robot = odometry.At(log.scans[i]->stamp);
    if (!T_odom_robot) continue;
    if (last) {
      const Pose2 moved = Between(T_odom_last, *T_odom_robot);
      const bool late = SecondsFromStamp(log.scans[i]->stamp - log.scans[*last]->stamp) > kLongestStep_s;
      const bool enough = moved.translation().norm() >= kPairStep_m || std::abs(moved.theta) >= kPairStep_rad;
      if (!late && !enough) continue;
      if (enough && !late) pairs.push_back({*last, i});
    }
    last = i;
    T_odom_last = *T_odom_robot;
  }
  return Thinned(pairs, most);
}

std::vector<PairOfScans> PairsOfUnequalTurns(const LaserLog& log, const OdometryPath& odometry, std::size_t most) {
  struct Candidate {
    PairOfScans pair;
    double difference = 0.0;
  };
  std::vector<double> rates;
  std::vector<std::optional<Pose2>> poses;
  for (const auto& scan : log.scans) {
    rates.push_back(odometry.TurnRate(scan->stamp, kRateWindow_s));
    poses.push_back(odometry.At(scan->stamp));
  }
  // Every scan in a turn, with the scan near it at the most different speed.
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < log.scans.size(); ++i) {
    if (!poses[i]) continue;
    Candidate best;
    const auto consider = [&](std::size_t k) {
      if (!poses[k] || (poses[i]->translation() - poses[k]->translation()).norm() > kNear_m) return;
      const double difference = std::abs(rates[i] - rates[k]);
      if (std::abs(rates[i]) >= std::abs(rates[k]) && difference > best.difference) best = {{k, i}, difference};
    };
    const auto near = [&](std::size_t k) {
      return std::abs(SecondsFromStamp(log.scans[i]->stamp - log.scans[k]->stamp)) <= kNear_s;
    };
    for (std::size_t k = i; k-- > 0 && near(k);) consider(k);
    for (std::size_t k = i + 1; k < log.scans.size() && near(k); ++k) consider(k);
    if (best.difference >= kUnequal_rad_s) candidates.push_back(best);
  }
  // Of more than twice as many, the half that shows less is left out; the rest is spread over the log.
  std::vector<double> differences;
  differences.reserve(candidates.size());
  for (const Candidate& candidate : candidates) differences.push_back(candidate.difference);
  double least = 0.0;
  if (differences.size() > 2 * most) {
    const auto nth = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() - 2 * most);
    std::nth_element(differences.begin(), nth, differences.end());
    least = *nth;
  }
  std::vector<PairOfScans> pairs;
  for (const Candidate& candidate : candidates)
    if (candidate.difference >= least) pairs.push_back(candidate.pair);
  return Thinned(pairs, most);
}

std::vector<AlignedPair> AlignPairs(const LaserLog& log, const OdometryPath& odometry,
                                    std::span<const PairOfScans> pairs, const LaserGuess& guess,
                                    const ParallelFor& parallel_for) {
  std::vector<AlignedPair> aligned(pairs.size());
  parallel_for(static_cast<int>(pairs.size()), [&](int begin, int end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      const auto first = AtOnce(*log.scans[pairs[k].first], guess, odometry);
      const auto second = AtOnce(*log.scans[pairs[k].second], guess, odometry);
      if (!first || !second) continue;
      const auto T_odom_first = odometry.At(first->stamp), T_odom_second = odometry.At(second->stamp);
      if (!T_odom_first || !T_odom_second) continue;
      const Pose2 start = Between(*T_odom_first * guess.T_robot_laser, *T_odom_second * guess.T_robot_laser);
      const PointIndex reference(first->points_laser);
      AlignedPair& pair = aligned[k];
      pair.match = AlignPointsToSurfaces(second->points_laser, reference,
                                         {start, start, PoseCovariance(kFree_m, kFree_rad)}, {});
      pair.found = pair.match.converged;
      pair.first = first->stamp;
      pair.second = second->stamp;
      pair.disagreement = Disagreement(second->points_laser, reference, pair.match.T_ref_curr);
    }
  });
  return aligned;
}

}  // namespace cairn::slam
