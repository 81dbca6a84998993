#include "client/lib/ros2_findings.h"

#include <fmt/format.h>

namespace cairn::client {
namespace {

// Nobody subscribes to the topics of a namespace that is no robot, so their rate is not known.
std::string TopicText(const Ros2Topic& topic, bool is_robot) {
  const std::string arrived =
      is_robot ? fmt::format("{:.1f} Hz, {} received", topic.rate_hz, topic.received) : "not listened to";
  return fmt::format("{} ({}): {} publisher{}, {}{}, {}{}", topic.name, topic.type, topic.publishers,
                     topic.publishers == 1 ? "" : "s", topic.reliable ? "reliable" : "best effort",
                     topic.transient_local ? ", transient local" : "", arrived,
                     topic.refused > 0 ? fmt::format(", {} refused", topic.refused) : "");
}

Ros2Findings::Namespace FindingsOf(const Ros2Namespace& one) {
  Ros2Findings::Namespace findings;
  findings.name = one.name;
  findings.who = one.robot.empty() ? "no robot" : fmt::format("robot {} in site {}", one.robot, one.site);
  findings.on_map = one.on_map;
  findings.problems = one.problems;
  for (const Ros2Topic& topic : one.topics) findings.topics.push_back(TopicText(topic, !one.robot.empty()));
  return findings;
}

// What was lost, or nothing.
std::string LossesText(const Ros2DoorState& door) {
  if (door.malformed == 0 && door.overflow == 0 && door.unpublished == 0) return {};
  return fmt::format(
      "; messages since the server's start: {} not decoded, {} dropped for want of room, {} not published",
      door.malformed, door.overflow, door.unpublished);
}

const char* StateText(const Ros2Findings::Namespace& one) {
  if (!one.on_map) return ": NOT on the map";
  return one.problems.empty() ? ": on the map" : ": on the map, but:";
}

}  // namespace

Ros2Findings FindingsOf(const Ros2Report& report) {
  Ros2Findings findings;
  findings.where = fmt::format("ROS 2 in DDS domain {}{}", report.door.domain, LossesText(report.door));
  findings.problems = report.door.problems;
  for (const Ros2Namespace& one : report.namespaces) findings.namespaces.push_back(FindingsOf(one));
  if (report.namespaces.empty()) {
    findings.advice =
        "no namespace publishes laser scans or odometry: is ROS_DOMAIN_ID the same, is ros2.interfaces the address of "
        "this server in the robots' network, and is ROS_LOCALHOST_ONLY off?";
  }
  return findings;
}

std::string FormatRos2(const Ros2Findings& findings) {
  std::string text = findings.where + "\n";
  for (const std::string& problem : findings.problems) text += fmt::format("! {}\n", problem);
  if (!findings.advice.empty()) text += findings.advice + "\n";
  for (const Ros2Findings::Namespace& one : findings.namespaces) {
    text += fmt::format("{}  {}{}\n", one.name, one.who, StateText(one));
    for (const std::string& problem : one.problems) text += fmt::format("  - {}\n", problem);
    for (const std::string& topic : one.topics) text += fmt::format("    {}\n", topic);
  }
  return text;
}

}  // namespace cairn::client
