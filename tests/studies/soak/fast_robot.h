// A simulated robot that sends a server its scans as fast as the server settles them, and measures the time from each
// scan's publication to its pose. Throws std::runtime_error where the server takes no scan any more.
// Thread rule: one thread; poses arrive on threads of the wire.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/lib/robot_client.h"
#include "client/sim/fleet.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {

class FastRobot {
 public:
  // Carried by the only robot of the fleet, whose scans come at scan_hz. `bus` outlives the robot.
  FastRobot(wire::Bus& bus, const std::string& name, sim::Fleet fleet, double scan_hz);

  // Sends so much simulated time of its drive, or of standing where it is: the last scan again and again.
  void Drive(double seconds);
  void Stand(double seconds);
  // Waits until all scans are settled, and takes the times from scan to pose since the last call (ms).
  [[nodiscard]] Distribution TakeLatencies();
  // The server's account of the scans.
  [[nodiscard]] Ledger ledger() const;
  [[nodiscard]] std::uint64_t scans() const { return scans_; }

 private:
  using Clock = std::chrono::steady_clock;
  void Send(LogRecord&& record);
  void OnPose(const PoseReport& pose);

  sim::Fleet fleet_;
  const Stamp period_;
  std::uint64_t scans_ = 0;
  Stamp now_ = 0;  // Of the newest record, its first stamp from the fleet.
  std::optional<Scan> last_scan_;
  Pose2 T_odom_robot_;
  Mutex mutex_;
  std::map<Stamp, Clock::time_point> departures_ CAIRN_GUARDED_BY(mutex_);  // Of scans without a pose.
  std::vector<double> latency_ms_ CAIRN_GUARDED_BY(mutex_);
  std::unique_ptr<client::RobotClient> client_;  // Last: its callbacks use the above.
};

}  // namespace cairn::studies
