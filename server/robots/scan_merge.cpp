#include "server/robots/scan_merge.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>

namespace cairn::server {
namespace {

// A lidar that has sent nothing for so long is not waited for.
constexpr std::chrono::seconds kAtWork{1};
constexpr Stamp kApartNs = 1000;                       // Between two scans that were taken at the same moment.
constexpr std::uint64_t kMostMovedNs = 16 * kApartNs;  // A session has at most 16 sensors.
constexpr Stamp kLatest = std::numeric_limits<Stamp>::max() - kApartNs;  // A later stamp cannot be moved.

}  // namespace

std::vector<ScanArrival> ScanMerge::Add(ScanArrival&& scan, Clock::time_point now) {
  lidars_[scan.stream.sensor_id] = {scan.scan->stamp, now};
  if (!first_at_) first_at_ = now;
  const Stamp stamp = scan.scan->stamp;
  held_.emplace(stamp, Held{std::move(scan), now});
  return TakeDue(now);
}

std::vector<ScanArrival> ScanMerge::TakeDue(Clock::time_point now) {
  std::vector<ScanArrival> out;
  if (WaitsForOdometry(now)) return out;
  const auto waited = [now](const auto& one) { return now - one.second.since >= kPatience; };
  while (!held_.empty() && (held_.size() > kMostHeld || MayGo(held_.begin()->second, now) ||
                            std::any_of(held_.begin(), held_.end(), waited)))
    PassFirst(out);
  return out;
}

std::vector<ScanArrival> ScanMerge::TakeAll() {
  std::vector<ScanArrival> out;
  while (!held_.empty()) PassFirst(out);
  return out;
}

bool ScanMerge::WaitsForOdometry(Clock::time_point now) {
  if (odometry_patience_ == Clock::duration{}) return false;
  const bool waits = !first_at_ || (now - *first_at_ < odometry_patience_ && held_.size() < most_waiting_);
  if (!waits) OdometryCame();
  return waits;
}

bool ScanMerge::MayGo(const Held& held, Clock::time_point now) const {
  return std::all_of(lidars_.begin(), lidars_.end(), [&](const auto& one) {
    const auto& [sensor, lidar] = one;
    return sensor == held.scan.stream.sensor_id || now - lidar.arrived > kAtWork ||
           lidar.newest >= held.scan.scan->stamp;
  });
}

// Another lidar than that of the last scan has measured at the same moment, as far as the stamps of those that did so
// before it were moved.
bool ScanMerge::IsOfOneMoment(NameId sensor, Stamp stamp) const {
  const auto [last_sensor, last] = *last_;
  return sensor != last_sensor && stamp <= last && last < kLatest && NanosBetween(stamp, last) <= kMostMovedNs;
}

void ScanMerge::PassFirst(std::vector<ScanArrival>& out) {
  ScanArrival scan = std::move(held_.begin()->second.scan);
  held_.erase(held_.begin());
  const NameId sensor = scan.stream.sensor_id;
  if (last_ && IsOfOneMoment(sensor, scan.scan->stamp)) {
    auto later = std::make_shared<Scan>(*scan.scan);
    later->stamp = last_->second + kApartNs;
    scan.scan = std::move(later);
  }
  last_ = {sensor, scan.scan->stamp};
  out.push_back(std::move(scan));
}

}  // namespace cairn::server
