#include "common/bag/scan_order.h"

#include <algorithm>
#include <cstdint>
#include <limits>

namespace cairn::bag {
namespace {

constexpr std::uint64_t kAtWorkNs = kNanosPerSecond;
constexpr Stamp kApartNs = 1000;                                         // Between two scans of the same moment.
constexpr std::uint64_t kMostMovedNs = 16 * kApartNs;                    // A robot has at most 16 lidars.
constexpr Stamp kLatest = std::numeric_limits<Stamp>::max() - kApartNs;  // A later stamp cannot be moved.

}  // namespace

bool ScanOrder::Add(Scan&& scan, std::size_t lidar) {
  const Stamp stamp = scan.stamp;
  // The clock was set back: what waits is of the time before.
  if (newest_[lidar] && stamp < *newest_[lidar]) Finish();
  // Each lidar is waited for from the first scan on.
  if (!before_first_) before_first_ = std::max(stamp, std::numeric_limits<Stamp>::min() + 1) - 1;
  newest_[lidar] = stamp;
  held_.emplace(stamp, Held{std::move(scan), lidar});
  while (goes_on_ && !held_.empty() && (held_.size() > kMostHeld || MayGo(held_.begin()->second))) PassFirst();
  return goes_on_;
}

bool ScanOrder::Finish() {
  while (goes_on_ && !held_.empty()) PassFirst();
  return goes_on_;
}

bool ScanOrder::MayGo(const Held& held) const {
  Stamp newest = *newest_[held.lidar];
  for (const std::optional<Stamp>& one : newest_) newest = std::max(newest, one.value_or(newest));
  for (std::size_t lidar = 0; lidar < newest_.size(); ++lidar) {
    const Stamp its_newest = newest_[lidar].value_or(*before_first_);
    if (lidar != held.lidar && its_newest < held.scan.stamp && NanosBetween(its_newest, newest) <= kAtWorkNs)
      return false;
  }
  return true;
}

bool ScanOrder::PassFirst() {
  Held held = std::move(held_.begin()->second);
  held_.erase(held_.begin());
  Stamp& stamp = held.scan.stamp;
  const bool of_one_moment = last_ && last_->first != held.lidar && stamp <= last_->second && last_->second < kLatest &&
                             NanosBetween(stamp, last_->second) <= kMostMovedNs;
  if (of_one_moment) stamp = last_->second + kApartNs;
  last_ = {held.lidar, stamp};
  return goes_on_ = sink_(std::move(held.scan), held.lidar);
}

}  // namespace cairn::bag
