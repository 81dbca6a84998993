// A client of a robot that remembers every pose that it was told. Thread-safe.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "client/lib/robot_client.h"
#include "common/sensor/log_record.h"
#include "tests/loopback.h"

namespace cairn::test {

class Rider {
 public:
  // Without `start` the session goes on where it was. Publish never waits.
  Rider(wire::Bus& bus, const std::string& robot, const std::string& site, const std::optional<Pose2>& start,
        client::RobotClientOptions options = {}) {
    SessionRequest request;
    request.robot = robot;
    request.site = site;
    request.sensors = {"laser"};
    request.has_start = start.has_value();
    request.T_map_robot_start = start.value_or(Pose2{});
    options.window = 0;
    client::RobotClient::Callbacks callbacks;
    callbacks.pose = [this](const PoseReport& pose) {
      const MutexLock lock(mutex_);
      poses_[pose.stamp] = pose;
    };
    callbacks.restarted = [this](SessionToken, const Pose2& T_map_robot_start) {
      const MutexLock lock(mutex_);
      T_map_robot_restarted_ = T_map_robot_start;
    };
    client_ = Must(client::RobotClient::Open(bus, request, 20.0, std::move(callbacks), options));
  }

  void Publish(const LogRecord& record) {
    if (const auto* const scan = std::get_if<Scan>(&record)) {
      Must(client_->Publish(*scan));
      ++scans_;
    } else {
      Must(client_->Publish(std::get<Odometry>(record)));
    }
  }
  [[nodiscard]] client::RobotClient& client() { return *client_; }
  // By the stamps of their scans.
  [[nodiscard]] std::map<Stamp, PoseReport> poses() const {
    const MutexLock lock(mutex_);
    return poses_;
  }
  // Where the last session began that the client has opened by itself: the identity if it gave no start.
  [[nodiscard]] std::optional<Pose2> T_map_robot_restarted() const {
    const MutexLock lock(mutex_);
    return T_map_robot_restarted_;
  }
  [[nodiscard]] std::size_t scans() const { return scans_; }  // Published; for the thread that publishes.

 private:
  mutable Mutex mutex_;
  std::map<Stamp, PoseReport> poses_ CAIRN_GUARDED_BY(mutex_);
  std::optional<Pose2> T_map_robot_restarted_ CAIRN_GUARDED_BY(mutex_);
  std::size_t scans_ = 0;
  std::unique_ptr<client::RobotClient> client_;
};

}  // namespace cairn::test
