// What the door for ROS 2 robots sees: namespaces, what they publish, and why a robot is not on the map. Plain values.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace cairn {

struct Ros2Topic {
  std::string name;  // As ROS shows it: "/r1/scan".
  std::string type;  // "sensor_msgs/msg/LaserScan".
  std::uint32_t publishers = 0;
  bool reliable = false;  // What its publishers offer.
  bool transient_local = false;
  double rate_hz = 0.0;  // Received in the last seconds.
  std::uint64_t received = 0;
  std::uint64_t refused = 0;  // Not decoded, or over the limits.
};

struct Ros2Namespace {
  std::string name;   // "/", "/r1".
  std::string robot;  // Empty where no rule fits.
  std::string site;
  bool on_map = false;                // Scans are used, and its last pose is localized.
  std::vector<std::string> problems;  // Why not, or what else is wrong, in the order in which to mend it.
  std::vector<Ros2Topic> topics;
};

struct Ros2DoorState {
  bool enabled = false;
  std::int64_t domain = 0;
  // Since the server's start: messages that were not decoded, that found no room in the server's queue, and that could
  // not be published.
  std::uint64_t malformed = 0;
  std::uint64_t overflow = 0;
  std::uint64_t unpublished = 0;
  std::vector<std::string> problems;  // Of all robots together.
};

struct Ros2Report {
  Ros2DoorState door;
  std::vector<Ros2Namespace> namespaces;
};

}  // namespace cairn
