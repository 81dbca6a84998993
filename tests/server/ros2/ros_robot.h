// A ROS 2 robot at the door, for the tests of RobotStream: what it sends, and what reaches the server.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "server/ros2/robot_stream.h"

namespace cairn::server {

inline constexpr ros2::WriterId kLidar{1}, kBase{2}, kStatic{3}, kOther{4};
inline constexpr Stamp kStart = 1000 * kNanosPerSecond;

class RosRobot : public ::testing::Test {
 protected:
  RosRobot() { robot_.SetPublishers(true, true, now_); }

  static ros2::Transforms Mounting(const std::string& parent = "base_link", const std::string& frame = "laser") {
    ros2::Transform transform;
    transform.header.frame = parent;
    transform.child_frame = frame;
    transform.T_frame_child.translation = {0.2, 0.0, 0.3};
    ros2::Transforms message;
    message.transforms.push_back(transform);
    return message;
  }
  void Mount() { robot_.Take(Mounting(), {kStatic, 1}, now_); }

  static ros2::LaserScan ScanMessage(std::int64_t number, std::size_t rays = 2) {
    ros2::LaserScan message;
    message.header = {kStart + number * 100'000'000, "laser"};
    message.angle_increment = 0.1;
    message.range_max = 10.0;
    message.ranges.assign(rays, 1.0F);
    return message;
  }
  void Scan(std::int64_t number, const ros2::WriterId& writer = kLidar, const std::string& topic = "scan") {
    robot_.Take(topic, ScanMessage(number), {writer, number}, now_);
  }
  void Odom(std::int64_t number, double x = 0.0) {
    ros2::Odometry message;
    message.header = {kStart + number * 100'000'000, "odom"};
    message.child_frame = "base_link";
    message.pose.translation.x() = x;
    robot_.Take(std::move(message), {kBase, number}, now_);
  }

  // A scan of the session was used.
  void Pose(bool localized = true, PoseReason reason = PoseReason::kTracking) {
    PoseReport report;
    report.session = request_.session;
    report.localized = localized;
    report.reason = reason;
    robot_.Take(report, now_);
  }
  // An initial pose.
  void SayWhereItIs(double x, const std::string& frame = "map") {
    ros2::PoseWithCovariance start;
    start.header.frame = frame;
    start.pose.translation = {x, 4.0, 0.0};
    robot_.TakeStart(start, now_);
  }
  std::vector<std::string> Problems(const std::set<ros2::WriterId>& others = {}) const {
    return robot_.Problems(now_, clock_, others);
  }

  template <typename Value>
  std::vector<Value> Pushed() {
    std::vector<Value> all;
    while (inbound_.size() > 0) {
      auto value = inbound_.Pop();
      if (auto* const one = std::get_if<Value>(&*value)) all.push_back(std::move(*one));
    }
    return all;
  }
  std::vector<InboundValue> Everything() {
    std::vector<InboundValue> all;
    while (inbound_.size() > 0) all.push_back(*inbound_.Pop());
    return all;
  }
  void Open() {
    Mount();
    Odom(1);
    Scan(1);
    const auto requests = Pushed<SessionRequest>();
    ASSERT_EQ(requests.size(), 1U);
    request_ = requests.front();
  }
  SessionState State(SessionPhase phase) const {
    SessionState state;
    state.robot_id = HashName("r1");
    state.client = request_.client;
    state.session = request_.session;
    state.phase = phase;
    return state;
  }
  SessionRefusal Refusal(StatusCode code, const std::string& why) const {
    SessionRefusal refusal{State(SessionPhase::kRefused)};
    refusal.state.status = {code, why};
    return refusal;
  }

  Inbound inbound_{64};
  ros2::FrameTree shared_;
  Ros2Options options_;
  RobotStream robot_{{"r1", "lab"}, options_, shared_, inbound_};
  RobotStream::Clock::time_point now_ = RobotStream::Clock::time_point() + std::chrono::hours(1);
  Stamp clock_ = kStart;    // Of the server. That of the robot says about the same.
  SessionRequest request_;  // That of its session.
};

}  // namespace cairn::server
