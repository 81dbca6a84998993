#include "client/cli/turn_check.h"

#include <algorithm>
#include <cmath>

#include "common/geometry/angle.h"

namespace cairn::client {
namespace {

constexpr int kMostColumns = 360;
constexpr double kWidest_rad = 0.9, kFewest = 30, kTurned_rad = 0.03, kStood_rad = 0.002, kSeen_rad = 0.015;
constexpr std::size_t kMostSamples = 4096, kMostWaiting = 1024;
// Differences of two such stamps, and a little more, fit into an int64.
constexpr Stamp kLatestStamp = std::int64_t{1} << 61;

// How far the second profile is turned against the first one; nothing if no shift is clearly the best.
std::optional<double> TurnBetween(const std::vector<float>& a, const std::vector<float>& b, double step_rad) {
  const auto columns = static_cast<int>(a.size());
  const bool full_turn = std::abs(columns * std::abs(step_rad) - 2 * kPi) < 1.5 * std::abs(step_rad);
  const int widest = std::min(columns / 3, static_cast<int>(kWidest_rad / std::abs(step_rad)));
  std::vector<double> costs;
  for (int shift = -widest; shift <= widest; ++shift) {
    double sum = 0.0;
    int count = 0;
    for (int i = 0; i < columns; ++i) {
      int k = i + shift;
      if (full_turn) k = (k + columns) % columns;
      if (k < 0 || k >= columns || a[static_cast<std::size_t>(k)] <= 0.0F || b[static_cast<std::size_t>(i)] <= 0.0F)
        continue;
      const double difference = std::abs(a[static_cast<std::size_t>(k)] - b[static_cast<std::size_t>(i)]);
      sum += std::min(difference, 0.5);
      ++count;
    }
    costs.push_back(count >= columns / 4 ? sum / count : 1.0);
  }
  const auto best = static_cast<int>(std::min_element(costs.begin(), costs.end()) - costs.begin());
  if (best == 0 || best == 2 * widest) return std::nullopt;
  const double before = costs[static_cast<std::size_t>(best - 1)], at = costs[static_cast<std::size_t>(best)],
               after = costs[static_cast<std::size_t>(best + 1)], bend = before - 2 * at + after;
  const double fine = bend > 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
  return (best - widest + fine) * step_rad;
}

}  // namespace

double TurnCheck::Sums::Correlation() const {
  return count > 0 && xx > 0.0 && yy > 0.0 ? xy / std::sqrt(xx * yy) : 0.0;
}

void TurnCheck::Add(const Scan& scan) {
  const int stride = static_cast<int>(scan.ranges_m.size()) / kMostColumns + 1;
  if (!ValidateScan(scan) || std::abs(scan.stamp) >= kLatestStamp || scan.tilt_rad != 0.0) return;
  Profile now{scan.stamp, scan.angle_step_rad * stride, {}};
  for (std::size_t i = 0; i < scan.ranges_m.size(); i += static_cast<std::size_t>(stride)) {
    const bool hit = ClassifyRange(scan.ranges_m[i], scan.range_min_m, scan.range_max_m) == BeamClass::kHit;
    now.ranges_m.push_back(hit ? scan.ranges_m[i] : 0.0F);
  }
  if (last_ && now.stamp > last_->stamp && SecondsFromStamp(now.stamp - last_->stamp) < 1.0 &&
      last_->ranges_m.size() == now.ranges_m.size() && now.ranges_m.size() >= 16) {
    if (const auto turn = TurnBetween(last_->ranges_m, now.ranges_m, now.step_rad))
      waiting_.push_back({last_->stamp, now.stamp, *turn});
    if (waiting_.size() > kMostWaiting) waiting_.pop_front();
  }
  last_ = std::move(now);
}

void TurnCheck::Add(const Odometry& odometry) {
  if (std::abs(odometry.stamp) >= kLatestStamp || !ValidateOdometry(odometry)) return;
  if (!odometry_.empty() && odometry.stamp <= odometry_.back().stamp) return;
  odometry_.push_back(odometry);
  if (odometry_.size() > kMostSamples) odometry_.pop_front();
  while (!waiting_.empty() && waiting_.front().to + StampFromSeconds(kWidest_s) <= odometry.stamp) {
    Settle(waiting_.front());
    waiting_.pop_front();
  }
}

std::optional<double> TurnCheck::HeadingAt(Stamp stamp) const {
  const auto after = std::lower_bound(odometry_.begin(), odometry_.end(), stamp,
                                      [](const Odometry& sample, Stamp wanted) { return sample.stamp < wanted; });
  if (after == odometry_.end() || after == odometry_.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double gap_s = SecondsFromStamp(after->stamp - before->stamp);
  if (gap_s > 0.5) return std::nullopt;
  const double share = SecondsFromStamp(stamp - before->stamp) / gap_s;
  return before->T_odom_robot.theta + share * AngleDiff(after->T_odom_robot.theta, before->T_odom_robot.theta);
}

void TurnCheck::Settle(const Pair& pair) {
  std::array<double, kLags> turned{};
  double odometry_most = 0.0;
  for (int k = 0; k < kLags; ++k) {
    const Stamp lag = StampFromSeconds(k * kStep_s - kWidest_s);
    const auto from = HeadingAt(pair.from - lag), to = HeadingAt(pair.to - lag);
    if (!from || !to) return;  // All lags are compared over the same pairs.
    turned[static_cast<std::size_t>(k)] = AngleDiff(*to, *from);
    odometry_most = std::max(odometry_most, std::abs(turned[static_cast<std::size_t>(k)]));
  }
  AddStanding(odometry_most, pair.turn_rad);
  if (std::max(odometry_most, std::abs(pair.turn_rad)) < kTurned_rad) return;
  for (std::size_t k = 0; k < sums_.size(); ++k) {
    sums_[k].xy += turned[k] * pair.turn_rad;
    sums_[k].xx += turned[k] * turned[k];
    sums_[k].yy += pair.turn_rad * pair.turn_rad;
    ++sums_[k].count;
  }
}

// Turns to both sides, as noise and people cause them, take each other away; what a standing robot shows in an hour may
// not add up.
void TurnCheck::AddStanding(double odometry_turn_rad, double scan_turn_rad) {
  if (odometry_turn_rad >= kStood_rad) {
    standing_turn_rad_ = 0.0;
  } else if (std::abs(scan_turn_rad) >= kSeen_rad) {
    standing_turn_rad_ += scan_turn_rad;
  }
  standing_most_rad_ = std::max(standing_most_rad_, std::abs(standing_turn_rad_));
}

TurnFinding TurnCheck::Finish() {
  TurnFinding finding;
  finding.turned_while_standing_rad = standing_most_rad_;
  finding.pairs = sums_.front().count;
  if (static_cast<double>(finding.pairs) < kFewest) return finding;
  std::size_t best = 0;
  for (std::size_t k = 0; k < sums_.size(); ++k)
    if (std::abs(sums_[k].Correlation()) > std::abs(sums_[best].Correlation())) best = k;
  finding.correlation = sums_[best].Correlation();
  finding.correlation_at_once = sums_[sums_.size() / 2].Correlation();
  finding.lag_s = static_cast<double>(best) * kStep_s - kWidest_s;
  return finding;
}

}  // namespace cairn::client
