// A robot that stands where its log ends: a client that continues the robot's session and sends the log's last scan and
// odometry again and again, and that notes when a server which was started later gives it a pose.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "client/lib/robot_client.h"
#include "common/mutex.h"
#include "common/sensor/log_record.h"
#include "common/wire/bus.h"

namespace cairn::studies {

// Thread rule: Publish from one thread, the others from any.
class StandingRobot {
 public:
  using Clock = std::chrono::steady_clock;

  // The server knows the session. Throws std::runtime_error where it does not, or where the log cannot be read.
  StandingRobot(wire::Bus& bus, const std::string& robot, const std::string& site, const std::filesystem::path& log);
  ~StandingRobot() { client_.reset(); }
  StandingRobot(const StandingRobot&) = delete;
  StandingRobot& operator=(const StandingRobot&) = delete;

  // One scan and the odometry before and after it, 0.1 s after the ones before.
  void Publish();
  // The server will be killed now: from here on a pose counts if a later server has told it, of a later scan.
  void Expect();
  // When that pose arrived.
  [[nodiscard]] std::optional<Clock::time_point> back() const;
  // New sessions, because the server did not know the one before.
  [[nodiscard]] int restarted() const { return client_->restarted(); }

 private:
  void Take(const PoseReport& pose);

  Odometry odometry_;
  Scan scan_;
  mutable Mutex mutex_;
  std::optional<PoseReport> last_ CAIRN_GUARDED_BY(mutex_);
  Stamp published_ CAIRN_GUARDED_BY(mutex_) = 0;  // Of the newest scan.
  Generation before_ CAIRN_GUARDED_BY(mutex_) = 0;
  Stamp after_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::optional<Clock::time_point> back_ CAIRN_GUARDED_BY(mutex_);
  std::unique_ptr<client::RobotClient> client_;  // Last: its callbacks use everything above.
};

}  // namespace cairn::studies
