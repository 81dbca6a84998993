// The queue in front of a robot's estimator. Events leave in the order of their arrival; scans, odometry and everything
// else have a lane each, with a bound and an overflow rule of its own.
// Overflow rules:
//  - scans: the oldest waiting one gives way and is returned, for the ledger (queue_full);
//  - odometry: the two oldest become one; poses in `odom` are absolute, so leaving out the older keeps all motion;
//  - corrections: the newest wins; one displaced is returned and never adopted;
//  - changes of the epoch: the newest stays, where two follow each other;
//  - snapshots, that the robot has to be found, and where it was found: refused while kMaxControl control events wait;
//  - that the start is refused: never refused, asked once;
//  - the end of the session: never refused. It is asked for once, and once more when the server stops; whoever asks
//    again waits for the first one, or is refused while kMaxControl control events wait.
// Thread rule: any thread.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "common/mutex.h"
#include "server/robots/robot_event.h"

namespace cairn::server {

class RobotQueue {
 public:
  static constexpr std::size_t kMaxControl = 64;

  RobotQueue(std::size_t max_scans, std::size_t max_odometry) : max_scans_(max_scans), max_odometry_(max_odometry) {}

  // The scan that gave way, if any.
  std::optional<ScanArrival> Push(ScanArrival scan);
  // The sample that was merged into its successor, if any.
  std::optional<OdometryArrival> Push(OdometryArrival odometry);
  // The correction that was superseded, if any.
  std::optional<Correction> Push(Correction correction);
  void Push(EpochChange change);
  // False where too many wait.
  bool Push(SnapshotWanted wanted);
  bool Push(RelocaliseWanted wanted);
  bool Push(LocaliseWanted wanted);
  bool Push(PlaceFound found);
  void Push(StartRefused refused);
  // False where too many wait.
  bool PushAgain(Finish finish);
  void Push(Finish finish);

  // The event that arrived first.
  [[nodiscard]] std::optional<RobotEvent> Pop();
  // Takes all waiting scans out, oldest first (the server stops and has no time left).
  [[nodiscard]] std::deque<ScanArrival> TakeScans();
  [[nodiscard]] bool empty() const;

 private:
  bool PushIfRoom(RobotEvent event);

  template <typename T>
  struct Arrived {
    std::uint64_t number;
    T event;
  };

  const std::size_t max_scans_;
  const std::size_t max_odometry_;

  mutable Mutex mutex_;
  std::uint64_t next_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::deque<Arrived<ScanArrival>> scans_ CAIRN_GUARDED_BY(mutex_);
  std::deque<Arrived<OdometryArrival>> odometry_ CAIRN_GUARDED_BY(mutex_);
  std::deque<Arrived<RobotEvent>> control_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::server
