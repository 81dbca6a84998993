#include "server/robots/robot_queue.h"

#include <algorithm>
#include <utility>

namespace cairn::server {

std::optional<ScanArrival> RobotQueue::Push(ScanArrival scan) {
  const MutexLock lock(mutex_);
  std::optional<ScanArrival> displaced;
  if (scans_.size() >= max_scans_) {
    displaced = std::move(scans_.front().event);
    scans_.pop_front();
  }
  scans_.push_back({next_++, std::move(scan)});
  return displaced;
}

std::optional<OdometryArrival> RobotQueue::Push(OdometryArrival odometry) {
  const MutexLock lock(mutex_);
  std::optional<OdometryArrival> merged;
  if (odometry_.size() >= max_odometry_) {
    merged = std::move(odometry_.front().event);
    odometry_.pop_front();
  }
  odometry_.push_back({next_++, std::move(odometry)});
  return merged;
}

std::optional<Correction> RobotQueue::Push(Correction correction) {
  const MutexLock lock(mutex_);
  std::optional<Correction> superseded;
  const auto older = std::find_if(control_.begin(), control_.end(), [](const Arrived<RobotEvent>& waiting) {
    return std::holds_alternative<Correction>(waiting.event);
  });
  if (older != control_.end()) {
    superseded = std::get<Correction>(std::move(older->event));
    control_.erase(older);
  }
  control_.push_back({next_++, std::move(correction)});
  return superseded;
}

void RobotQueue::Push(EpochChange change) {
  const MutexLock lock(mutex_);
  if (!control_.empty() && std::holds_alternative<EpochChange>(control_.back().event)) control_.pop_back();
  control_.push_back({next_++, change});
}

bool RobotQueue::PushIfRoom(RobotEvent event) {
  const MutexLock lock(mutex_);
  if (control_.size() >= kMaxControl) return false;
  control_.push_back({next_++, std::move(event)});
  return true;
}

bool RobotQueue::Push(SnapshotWanted wanted) {
  return PushIfRoom(std::move(wanted));
}

bool RobotQueue::Push(RelocaliseWanted wanted) {
  return PushIfRoom(wanted);
}

bool RobotQueue::Push(LocaliseWanted wanted) {
  return PushIfRoom(std::move(wanted));
}

bool RobotQueue::Push(PlaceFound found) {
  return PushIfRoom(std::move(found));
}

void RobotQueue::Push(StartRefused refused) {
  const MutexLock lock(mutex_);
  control_.push_back({next_++, std::move(refused)});
}

bool RobotQueue::PushAgain(Finish finish) {
  return PushIfRoom(std::move(finish));
}

void RobotQueue::Push(Finish finish) {
  const MutexLock lock(mutex_);
  control_.push_back({next_++, std::move(finish)});
}

std::optional<RobotEvent> RobotQueue::Pop() {
  const MutexLock lock(mutex_);
  constexpr std::uint64_t kNone = UINT64_MAX;
  const std::uint64_t scan = scans_.empty() ? kNone : scans_.front().number;
  const std::uint64_t odometry = odometry_.empty() ? kNone : odometry_.front().number;
  const std::uint64_t control = control_.empty() ? kNone : control_.front().number;
  const std::uint64_t first = std::min({scan, odometry, control});
  if (first == kNone) return std::nullopt;
  const auto take = [](auto& lane) {
    std::optional<RobotEvent> event(RobotEvent(std::move(lane.front().event)));
    lane.pop_front();
    return event;
  };
  if (first == scan) return take(scans_);
  if (first == odometry) return take(odometry_);
  return take(control_);
}

std::deque<ScanArrival> RobotQueue::TakeScans() {
  const MutexLock lock(mutex_);
  std::deque<ScanArrival> taken;
  for (auto& scan : scans_) taken.push_back(std::move(scan.event));
  scans_.clear();
  return taken;
}

bool RobotQueue::empty() const {
  const MutexLock lock(mutex_);
  return scans_.empty() && odometry_.empty() && control_.empty();
}

}  // namespace cairn::server
