// A robot that goes on where its log ends, back along the log's last half minute and forth again, backwards where it
// once drove forwards: a client that continues the robot's session, and notes when a server which was started later
// gives it a pose.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/lib/robot_client.h"
#include "common/mutex.h"
#include "common/sensor/log_record.h"
#include "common/wire/bus.h"

namespace cairn::studies {

// Thread rule: Publish from one thread, the others from any.
class ReturningRobot {
 public:
  using Clock = std::chrono::steady_clock;

  // The server knows the session. Throws std::runtime_error where it does not, or where the log cannot be read.
  ReturningRobot(wire::Bus& bus, const std::string& robot, const std::string& site, const std::filesystem::path& log);
  ~ReturningRobot() { client_.reset(); }
  ReturningRobot(const ReturningRobot&) = delete;
  ReturningRobot& operator=(const ReturningRobot&) = delete;

  // The next scan and its odometry, 0.1 s after the ones before.
  void Publish();
  // The server will be killed now: from here on a pose counts if a later server has told it, of a later scan.
  void Expect();
  // When that pose arrived.
  [[nodiscard]] std::optional<Clock::time_point> back() const;
  // Whether the server has stored a scan of its present session, and so the session: before, a server that is killed
  // need not know it.
  [[nodiscard]] bool stored() const {
    const auto ledger = client_->ledger();
    return ledger && ledger->session == client_->session().session && ledger->durable_through > 0;
  }
  // New sessions, because the server did not know the one before.
  [[nodiscard]] int restarted() const { return client_->restarted(); }

 private:
  void Take(const PoseReport& pose);

  struct Step {
    Odometry odometry;
    Scan scan;
  };
  std::vector<Step> steps_;
  std::size_t at_ = 0;
  int direction_ = -1;
  Stamp stamp_ = 0;
  mutable Mutex mutex_;
  std::optional<PoseReport> last_ CAIRN_GUARDED_BY(mutex_);
  Stamp published_ CAIRN_GUARDED_BY(mutex_) = 0;  // Of the newest scan.
  Generation before_ CAIRN_GUARDED_BY(mutex_) = 0;
  Stamp after_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::optional<Clock::time_point> back_ CAIRN_GUARDED_BY(mutex_);
  std::unique_ptr<client::RobotClient> client_;  // Last: its callbacks use everything above.
};

}  // namespace cairn::studies
