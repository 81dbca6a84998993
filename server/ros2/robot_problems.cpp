// Why a ROS 2 robot is not on the map, in words.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "server/ros2/robot_stream.h"

namespace cairn::server {
namespace {

constexpr std::chrono::seconds kSilent{2};
constexpr double kMaxClockDifference = 1.0;  // s

std::string SecondsText(double seconds) {
  std::string text(32, '\0');
  text.resize(static_cast<std::size_t>(std::snprintf(text.data(), text.size(), "%.1f s", seconds)));
  return text;
}

}  // namespace

std::string RobotStream::WhyNoOdometry(Clock::time_point now) const {
  if (!odometry_fault_.empty()) return odometry_fault_;
  if (odometry_is_fresh(now)) return {};
  if (odometry_stamp_)
    return "no odometry for " + SecondsText(std::chrono::duration<double>(now - odometry_received_).count());
  if (odometry_published_) {
    return "odometry is published, but none arrives: does a firewall drop UDP, or does the publisher use another data "
           "representation than XCDR1?";
  }
  return "there is no odometry: neither the topic " + options_.odom_topic + " nor a transform from '" +
         options_.odom_frame + "' to '" + options_.base_names().front() + "' on tf";
}

std::vector<std::string> RobotStream::ProblemsOfPose() const {
  std::vector<std::string> problems;
  if (!last_pose_) {
    problems.emplace_back("no scan has been used yet: `cairn status " + place_.robot + "` says what became of them");
  } else if (last_pose_->reason == PoseReason::kNotJoined) {
    problems.emplace_back(
        "nobody has said where it started, and it is not joined with the map of its site yet: publish an initial pose, "
        "or drive on through places that others have seen");
  } else if (!last_pose_->localized) {
    problems.push_back("the server has lost it (" + std::string(PoseReasonName(last_pose_->reason)) +
                       "): publish an initial pose, or drive on until it is found");
  }
  return problems;
}

std::vector<std::string> RobotStream::Problems(Clock::time_point now) const {
  std::vector<std::string> problems;
  if (lidars_.empty()) {
    problems.emplace_back(
        scans_published_ ? "scans are published, but none arrives: does a firewall drop UDP, or does the publisher "
                           "use another data representation than XCDR1?"
                         : "there is no laser scan on its topics (ros2.scan_topics)");
  }
  for (const auto& [topic, lidar] : lidars_) {
    if (!lidar.why_not.empty()) problems.push_back(topic + ": " + lidar.why_not);
    if (now - lidar.received > kSilent) {
      problems.push_back(topic + ": no scan for " +
                         SecondsText(std::chrono::duration<double>(now - lidar.received).count()));
    }
    if (!lidar.stamp || !odometry_stamp_ || now - lidar.received > kSilent || !odometry_is_fresh(now)) continue;
    const double apart = SecondsFromStamp(*lidar.stamp) - SecondsFromStamp(*odometry_stamp_);
    if (std::abs(apart) > kMaxClockDifference) {
      problems.push_back(topic + ": its stamps and those of the odometry are " + SecondsText(std::abs(apart)) +
                         " apart: their clocks differ, or one of them uses simulated time");
    }
  }
  if (std::string why = WhyNoOdometry(now); !why.empty()) problems.push_back(std::move(why));
  switch (phase_) {
    case Phase::kWaiting:
      break;
    case Phase::kRefused:
      problems.push_back("the server refuses its session: " + why_refused_);
      break;
    case Phase::kEnded:
      problems.push_back("its session was ended" + (why_refused_.empty() ? "" : " (" + why_refused_ + ")") +
                         "; it is opened again when the robot is started again or an initial pose is published");
      break;
    case Phase::kOpen:
      if (problems.empty()) problems = ProblemsOfPose();
      break;
  }
  return problems;
}

}  // namespace cairn::server
