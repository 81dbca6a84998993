// Why a ROS 2 robot is not on the map, and what else is wrong with it, in words.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "server/ros2/robot_stream.h"

namespace cairn::server {
namespace {

constexpr std::chrono::seconds kSilent{2};
constexpr std::chrono::seconds kPoseLasts{5};  // Scans may wait for the estimator.
constexpr double kMaxClockDifference = 1.0;    // s, of two publishers.
constexpr double kMaxFromServer = 3.0;         // s; more than a message may wait here.

double SecondsSince(RobotStream::Clock::time_point then, RobotStream::Clock::time_point now) {
  return std::chrono::duration<double>(now - then).count();
}

std::string SecondsText(double seconds) {
  std::string text(32, '\0');
  text.resize(static_cast<std::size_t>(std::snprintf(text.data(), text.size(), "%.1f s", seconds)));
  return text;
}

}  // namespace

std::string RobotStream::WhyNoOdometry(Clock::time_point now) const {
  if (!odometry_fault_.empty()) return odometry_fault_;
  if (odometry_is_fresh(now)) return {};
  if (odometry_stamp_) return "no odometry for " + SecondsText(SecondsSince(odometry_received_, now));
  if (odometry_published_) {
    return "odometry is published, but none arrives: does a firewall drop UDP, or does the publisher use another data "
           "representation than XCDR1?";
  }
  return "there is no odometry: neither the topic " + options_.odom_topic + " nor a transform from '" +
         options_.odom_frame + "' to '" + options_.base_names().front() + "' on tf" +
         (HasNoOdometry(now) ? " (it is followed by its scans alone until there is)" : "");
}

std::vector<std::string> RobotStream::ProblemsOfScans(Clock::time_point now) const {
  std::vector<std::string> problems;
  if (lidars_.empty()) {
    problems.emplace_back(
        scans_published_ ? "scans are published, but none arrives: does a firewall drop UDP, or does the publisher "
                           "use another data representation than XCDR1?"
                         : "there is no laser scan on its topics (ros2.scan_topics)");
  }
  for (const auto& [topic, lidar] : lidars_) {
    if (!lidar.why_not.empty()) problems.push_back(topic + ": " + lidar.why_not);
    if (now - lidar.received > kSilent)
      problems.push_back(topic + ": no scan for " + SecondsText(SecondsSince(lidar.received, now)));
    if (!lidar.stamp || !odometry_stamp_ || now - lidar.received > kSilent || !odometry_is_fresh(now)) continue;
    const double apart = SecondsFromStamp(*lidar.stamp) - SecondsFromStamp(*odometry_stamp_);
    if (std::abs(apart) > kMaxClockDifference) {
      problems.push_back(topic + ": its stamps and those of the odometry are " + SecondsText(std::abs(apart)) +
                         " apart: their clocks differ, or one of them uses simulated time");
    }
  }
  return problems;
}

std::string RobotStream::WhyNoSession() const {
  switch (phase_) {
    case Phase::kRefused:
      return "the server refuses its session: " + why_refused_;
    case Phase::kEnded:
      return "its session was ended" + (why_refused_.empty() ? "" : " (" + why_refused_ + ")") +
             "; it is opened again when the robot is started again or an initial pose is published";
    case Phase::kWaiting:
    case Phase::kOpen:
      break;
  }
  return {};
}

std::string RobotStream::WhyNoPose(Clock::time_point now) const {
  if (phase_ != Phase::kOpen) return {};
  const std::string ask = ": `cairn status " + place_.robot + "` says what became of them";
  if (!last_pose_) return "no scan has been used yet" + ask;
  if (last_pose_->reason == PoseReason::kNotJoined) {
    return "nobody has said where it started, and it is not joined with the map of its site yet: publish an initial "
           "pose, or drive on through places that others have seen";
  }
  if (!last_pose_->localized) {
    return "the server has lost it (" + std::string(PoseReasonName(last_pose_->reason)) +
           "): publish an initial pose, or drive on until it is found";
  }
  if (now - pose_received_ <= kPoseLasts) return {};
  return "no scan has been used for " + SecondsText(SecondsSince(pose_received_, now)) + ask;
}

// All that is published for the robot has the stamps of its scans.
std::string RobotStream::WhyOtherClock(Clock::time_point now, Stamp server_clock) const {
  for (const auto& [topic, lidar] : lidars_) {
    if (!lidar.stamp || now - lidar.received > kSilent) continue;
    const double ahead =
        SecondsFromStamp(*lidar.stamp) - (SecondsFromStamp(server_clock) - SecondsSince(lidar.received, now));
    if (std::abs(ahead) <= kMaxFromServer) continue;
    return topic + ": its stamps are " + SecondsText(std::abs(ahead)) + (ahead > 0.0 ? " ahead of" : " behind") +
           " the clock of the server: the map is not affected, but the transform from " + options_.map_frame + " to " +
           odom_frame_or_usual() + " has these stamps, and is of use only to nodes with the same clock";
  }
  return {};
}

// A lidar that looks all around turns, unless it is simulated. Many drivers do not say how.
std::vector<std::string> RobotStream::BeamTimesInDoubt(Clock::time_point now) const {
  std::vector<std::string> doubts;
  for (const auto& [topic, lidar] : lidars_) {
    if (!lidar.round_at_once || now - lidar.received > kSilent) continue;
    doubts.push_back(
        topic +
        ": time_increment is 0, so all its beams count as measured at once. If the lidar turns (a "
        "simulated one does not), the map is less exact wherever the robot turns: let its driver fill time_increment "
        "(`cairn-calibrate laser` measures the turn in a recording)");
  }
  return doubts;
}

bool RobotStream::OthersPublishMapToOdom(Clock::time_point now, const std::set<ros2::WriterId>& others) const {
  return std::any_of(map_to_odom_.begin(), map_to_odom_.end(), [&](const auto& one) {
    const auto& [writer, said] = one;
    return others.contains(writer) && (said.fixed || now - said.seen <= kSilent);
  });
}

bool RobotStream::IsOnMap(Clock::time_point now) const {
  const bool scans_arrive = std::any_of(lidars_.begin(), lidars_.end(),
                                        [now](const auto& one) { return now - one.second.received <= kSilent; });
  return phase_ == Phase::kOpen && scans_arrive && WhyNoPose(now).empty();
}

std::vector<std::string> RobotStream::Problems(Clock::time_point now, Stamp server_clock,
                                               const std::set<ros2::WriterId>& others) const {
  std::vector<std::string> problems = ProblemsOfScans(now);
  const auto add = [&problems](std::string&& why) {
    if (!why.empty()) problems.push_back(std::move(why));
  };
  add(WhyNoOdometry(now));
  add(WhyNoSession());
  add(WhyNoPose(now));
  if (phase_ == Phase::kWaiting && problems.empty()) problems.emplace_back("its session is not open yet");
  if (!why_hint_failed_.empty())
    problems.push_back("its last initial pose was not used (" + why_hint_failed_ + "): publish it again");
  if (OthersPublishMapToOdom(now, others)) {
    problems.push_back("another node also publishes " + options_.map_frame + " to " + odom_frame_or_usual() +
                       " (its localisation, such as AMCL or slam_toolbox, has to be stopped)");
  }
  add(WhyOtherClock(now, server_clock));
  for (std::string& doubt : BeamTimesInDoubt(now)) add(std::move(doubt));
  return problems;
}

}  // namespace cairn::server
