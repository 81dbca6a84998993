#include "common/sensor/log_survey.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace cairn {
namespace {

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double RoundTo(double value, double steps_per_unit) {
  const double rounded = std::round(value * steps_per_unit) / steps_per_unit;
  return rounded == 0.0 ? 0.0 : rounded;  // No negative zero.
}

}  // namespace

void LaserSurvey::Add(const LaserMessage& laser) {
  if (bins_.empty()) bins_.resize(kBins);
  const std::size_t beams = laser.ranges_m.size();
  for (std::size_t i = 0; i < beams; ++i) {
    const float range = laser.ranges_m[i];
    if (!(range > 0.0F)) continue;
    ++readings_;
    const float centimetres = range * 100.0F + 0.5F;
    if (!(centimetres < static_cast<float>(kBins))) continue;
    Bin& bin = bins_[static_cast<std::size_t>(centimetres)];
    ++bin.count;
    bin.sectors |= std::uint64_t{1} << (i * 64 / beams);
  }
  if (laser.T_odom_robot && laser.T_odom_laser && scans_ % stride_ == 0) {
    mountings_.push_back(Between(*laser.T_odom_robot, *laser.T_odom_laser));
    constexpr std::size_t kMostSamples = 8192;
    if (mountings_.size() == kMostSamples) {  // Thin out: bounded memory, evenly spread over the file.
      for (std::size_t i = 0; i < kMostSamples / 2; ++i) mountings_[i] = mountings_[2 * i];
      mountings_.resize(kMostSamples / 2);
      stride_ *= 2;
    }
  }
  ++scans_;
}

LaserSurvey::Bin LaserSurvey::Sum(int first, int last) const {
  Bin sum;
  for (int i = std::max(first, 0); i < std::min(last, kBins); ++i) {
    sum.count += bins_[static_cast<std::size_t>(i)].count;
    sum.sectors |= bins_[static_cast<std::size_t>(i)].sectors;
  }
  return sum;
}

std::optional<double> LaserSurvey::NoReturn() const {
  constexpr double kSpread = 0.0012;  // Saturated values lie at most this share below their most frequent one.
  constexpr double kAbove = 0.005;    // ... and this share above.
  constexpr int kNearest = 100;       // cm; no scanner saturates nearer than 1 m.
  if (bins_.empty()) return std::nullopt;
  // The top of what is seen, leaving out one reading in 2000: wild ones lie anywhere.
  int top = kBins;
  for (std::int64_t above = 0; top > 0 && above * 2000 <= readings_;) {
    above += bins_[static_cast<std::size_t>(--top)].count;
  }
  if (top < kNearest) return std::nullopt;
  const auto mode = std::max_element(bins_.begin() + std::max(top / 2, kNearest), bins_.begin() + top + 1,
                                     [](const Bin& a, const Bin& b) { return a.count < b.count; });
  const auto peak = static_cast<int>(mode - bins_.begin());
  const auto first = static_cast<int>(std::floor(peak * (1.0 - kSpread)));
  const auto last = static_cast<int>(std::ceil(peak * (1.0 + kAbove))) + 1;
  const int band = std::max(10, peak / 100);

  const Bin pile = Sum(first, last);
  const std::int64_t below = Sum(first - band, first).count;
  const std::int64_t above = Sum(last, kBins).count;
  const bool many = pile.count >= 100 && pile.count * 1000 >= readings_;
  const bool steep = pile.count >= 10 * below && above * 20 <= pile.count;
  const bool everywhere = std::popcount(pile.sectors) >= 16;
  if (!many || !steep || !everywhere) return std::nullopt;
  return first * 0.01;
}

std::optional<Pose2> LaserSurvey::Mounting() const {
  if (mountings_.empty()) return std::nullopt;
  const double reference = mountings_.front().theta;
  std::vector<double> xs, ys, turns;
  for (const Pose2& T_robot_laser : mountings_) {
    xs.push_back(T_robot_laser.x);
    ys.push_back(T_robot_laser.y);
    turns.push_back(AngleDiff(T_robot_laser.theta, reference));
  }
  const Pose2 median{Median(xs), Median(ys), WrapAngle(reference + Median(turns))};
  constexpr double kAgree = 5e-3;  // m and rad.
  const auto agreeing = std::count_if(mountings_.begin(), mountings_.end(), [&](const Pose2& T_robot_laser) {
    return (T_robot_laser.translation() - median.translation()).norm() <= kAgree &&
           std::abs(AngleDiff(T_robot_laser.theta, median.theta)) <= kAgree;
  });
  if (agreeing * 10 < static_cast<std::ptrdiff_t>(mountings_.size()) * 9) return std::nullopt;
  return Pose2{RoundTo(median.x, 1e3), RoundTo(median.y, 1e3), WrapAngle(RoundTo(median.theta, 1e4))};
}

}  // namespace cairn
