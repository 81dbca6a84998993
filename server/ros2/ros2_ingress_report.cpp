// What the door says of each namespace, and why its robot is not on the map; what it counts.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <set>
#include <string>

#include "common/wall_clock.h"
#include "server/ros2/ros2_ingress.h"

namespace cairn::server {
namespace {

constexpr std::size_t kMaxProblems = 16;
constexpr std::size_t kMaxText = 1000;  // The wire takes 1,024 bytes.

// "sensor_msgs/msg/LaserScan" of "sensor_msgs::msg::dds_::LaserScan_".
std::string ShownType(const std::string& wire) {
  std::string shown = wire;
  if (const std::size_t dds = shown.find("::dds_::"); dds != std::string::npos) {
    shown.replace(dds, 8, "/");
    if (shown.back() == '_') shown.pop_back();
  }
  for (std::size_t at = shown.find("::"); at != std::string::npos; at = shown.find("::")) shown.replace(at, 2, "/");
  return shown;
}

std::string ShownName(const std::string& wire) {
  return wire.substr(2);
}

}  // namespace

std::vector<std::string> Ros2Ingress::ProblemsOf(const std::string& name, const Namespace& one,
                                                 Clock::time_point now) const {
  std::vector<std::string> problems;
  if (!one.place) {
    problems.push_back("no rule of ros2.namespaces fits it (" + options_.namespaces + "): add one, such as " + name +
                       "=NAME");
  }
  for (const auto& [stream, topic] : one.topics) {
    if (topic.publishers == 0) continue;
    const bool is_scan = topic.type == ros2::Bus::TypeName<ros2::LaserScan>();
    const bool is_odometry = topic.type == ros2::Bus::TypeName<ros2::Odometry>();
    if (IsScan(stream) && !is_scan)
      problems.push_back(stream + " has the type " + ShownType(topic.type) + ", not sensor_msgs/msg/LaserScan");
    if (stream == options_.odom_topic && !is_odometry)
      problems.push_back(stream + " has the type " + ShownType(topic.type) + ", not nav_msgs/msg/Odometry");
    if (is_scan && !IsScan(stream)) {
      problems.push_back("it publishes laser scans on " + ShownName(TopicIn(name, stream)) +
                         ", which ros2.scan_topics does not name (" + options_.scan_topics + ")");
    }
    if (is_odometry && stream != options_.odom_topic) {
      problems.push_back("it publishes odometry on " + ShownName(TopicIn(name, stream)) + ", but ros2.odom_topic is " +
                         options_.odom_topic);
    }
    if ((IsScan(stream) || stream == options_.odom_topic) && topic.publishers > 1)
      problems.push_back(stream + " has " + std::to_string(topic.publishers) + " publishers; one is expected");
    if (stream == "tf_static" && !topic.all_transient_local) {
      problems.emplace_back(
          "tf_static has a publisher whose durability is volatile: what it published before the server "
          "started is not known; it has to be transient local");
    }
  }
  if (one.robot != nullptr) {
    for (std::string& problem : one.robot->Problems(now, WallClock(), writers_)) problems.push_back(std::move(problem));
  }
  if (problems.size() > kMaxProblems) problems.resize(kMaxProblems);
  for (std::string& problem : problems) problem.resize(std::min(problem.size(), kMaxText));
  return problems;
}

std::vector<Ros2Namespace> Ros2Ingress::report(Clock::time_point now) const {
  const MutexLock lock(mutex_);
  std::vector<Ros2Namespace> all;
  for (const auto& [name, one] : namespaces_) {
    Ros2Namespace shown;
    shown.name = name;
    if (one.place) {
      shown.robot = one.place->robot;
      shown.site = one.place->site;
    }
    shown.problems = ProblemsOf(name, one, now);
    shown.on_map = one.robot != nullptr && one.robot->IsOnMap(now);
    for (const auto& [stream, topic] : one.topics) {
      if (topic.publishers == 0) continue;
      shown.topics.push_back({.name = ShownName(TopicIn(name, stream)),
                              .type = ShownType(topic.type),
                              .publishers = topic.publishers,
                              .reliable = topic.all_reliable,
                              .transient_local = topic.all_transient_local,
                              .rate_hz = topic.rate_hz,
                              .received = topic.received,
                              .refused = topic.subscription != nullptr ? topic.subscription->refused() : 0});
    }
    all.push_back(std::move(shown));
  }
  return all;
}

std::vector<std::string> Ros2Ingress::problems() const {
  const MutexLock lock(mutex_);
  std::vector<std::string> problems;
  for (const std::string& frame : shared_frames_.contended()) {
    problems.push_back(
        "two publishers contend for the frame '" + frame +
        "' on /tf or /tf_static: give each robot tf topics in its namespace, or frames that begin with its name");
    if (problems.size() == kMaxProblems) break;
  }
  std::set<std::string> sites;
  for (const auto& [name, one] : namespaces_)
    if (one.place) sites.insert(one.place->site);
  for (const std::string& site : sites) {
    const std::string topic = "rt/" + TopicPart(site) + "/map";
    if (!foreign_maps_.contains(topic) || problems.size() >= kMaxProblems) continue;
    problems.push_back("another node also publishes " + ShownName(topic) +
                       " (map_server or slam_toolbox, for example, which has to be stopped or publish it elsewhere)");
  }
  if (publishers_left_out_ > 0)
    problems.emplace_back("there are more namespaces than ros2.max_robots; some are ignored");
  if (shared_frames_.full()) {
    problems.push_back("/tf and /tf_static have more than " + std::to_string(ros2::FrameTree::kMaxFrames) +
                       " frames; some are ignored: give the robots tf topics in their namespaces");
  }
  return problems;
}

void Ros2Ingress::Measure(Clock::time_point now) {
  const double seconds = std::chrono::duration<double>(now - measured_).count();
  if (seconds < 2.0) return;
  measured_ = now;
  const auto measure = [seconds](Topic& topic) {
    topic.rate_hz = static_cast<double>(topic.received - topic.received_before) / seconds;
    topic.received_before = topic.received;
  };
  for (auto& [stream, topic] : shared_) measure(topic);
  for (auto& [name, one] : namespaces_) {
    for (auto& [stream, topic] : one.topics) measure(topic);
  }
}

std::uint64_t Ros2Ingress::overflow() const {
  const MutexLock lock(mutex_);
  std::uint64_t sum = ended_overflow_;
  for (const auto& [name, one] : namespaces_) sum += one.robot != nullptr ? one.robot->overflow() : 0;
  return sum;
}

std::uint64_t Ros2Ingress::malformed() const {
  const MutexLock lock(mutex_);
  std::uint64_t sum = ended_refused_;
  const auto add = [&sum](const Topic& topic) {
    if (topic.subscription != nullptr) sum += topic.subscription->refused();
  };
  for (const auto& [stream, topic] : shared_) add(topic);
  for (const auto& [name, one] : namespaces_) {
    for (const auto& [stream, topic] : one.topics) add(topic);
  }
  return sum;
}

}  // namespace cairn::server
