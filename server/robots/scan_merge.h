// Puts the scans of all lidars of one robot into one order of stamps. Drivers that do not wait for each other deliver
// scans late and by turns, and the estimator uses no scan that is older than the last one. So a scan waits until each
// other lidar that is at work has sent one that is not older, at most kPatience and until the next call. A robot
// with a slow second lidar gets its poses up to 0.3 s later; the scans of a single lidar pass at once. Lidars may
// measure at the same moment; then each further scan gets a stamp that is a microsecond later, because the estimator
// needs stamps that increase. Bounded by the patience and by kMostHeld; beyond, the oldest scan passes early.
//
// The first scans wait for the first odometry of the robot, which comes on a topic of its own: a client that sends what
// it has kept, or replays a log, may be seconds ahead with its scans. The estimator would take it for a robot without
// odometry, and its path would depend on which of the two topics is faster. Not thread-safe; time is given by the
// caller.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "server/inbound.h"

namespace cairn::server {

class ScanMerge {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds kPatience{200};
  static constexpr std::size_t kMostHeld = 64;

  // After `odometry_patience`, or when `most_waiting` scans wait, no scan waits for odometry any more.
  explicit ScanMerge(Clock::duration odometry_patience = {}, std::size_t most_waiting = kMostHeld)
      : odometry_patience_(odometry_patience), most_waiting_(std::min(most_waiting, kMostHeld)) {}

  // Each returns the scans whose turn has come, in their order.
  [[nodiscard]] std::vector<ScanArrival> Add(ScanArrival&& scan, Clock::time_point now);
  [[nodiscard]] std::vector<ScanArrival> TakeDue(Clock::time_point now);
  // All that wait, because nothing more will come.
  [[nodiscard]] std::vector<ScanArrival> TakeAll();
  // From now on no scan waits for odometry.
  void OdometryCame() { odometry_patience_ = {}; }

 private:
  struct Lidar {
    Stamp newest = 0;
    Clock::time_point arrived{};
  };
  struct Held {
    ScanArrival scan;
    Clock::time_point since;
  };

  [[nodiscard]] bool WaitsForOdometry(Clock::time_point now);
  [[nodiscard]] bool MayGo(const Held& held, Clock::time_point now) const;
  [[nodiscard]] bool IsOfOneMoment(NameId sensor, Stamp stamp) const;
  void PassFirst(std::vector<ScanArrival>& out);

  Clock::duration odometry_patience_;          // Zero: no scan waits for odometry.
  std::size_t most_waiting_;                   // For odometry.
  std::optional<Clock::time_point> first_at_;  // When the first scan came.
  std::map<NameId, Lidar> lidars_;
  std::multimap<Stamp, Held> held_;
  std::optional<std::pair<NameId, Stamp>> last_;  // The lidar and the stamp of the last scan that passed.
};

}  // namespace cairn::server
