// Options of the door for ROS 2 robots.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/status.h"

namespace cairn::server {

struct Ros2Options {
  bool enabled = false;
  std::int64_t domain = 0;
  std::string interfaces;
  std::string discovery_servers;
  std::string namespaces = "/{robot}";
  std::string site = "lab";
  std::string scan_topics = "scan";
  std::string odom_topic = "odom";
  std::string odom_frame = "odom";
  std::string base_frames = "base_footprint,base_link";
  std::string map_frame = "map";
  double transform_tolerance_s = 1.0;
  double map_period_s = 5.0;
  std::int64_t max_map_cells = 25'000'000;
  std::int64_t max_robots = 256;
  bool commands = false;

  [[nodiscard]] std::vector<std::string> discovery_server_names() const;
  [[nodiscard]] std::vector<std::string> scan_names() const;
  [[nodiscard]] std::vector<std::string> base_names() const;
};
void Visit(OptionVisitor& visitor, Ros2Options& options);
// Checks the addresses of discovery servers, the rules of namespaces, and the names of the site, topics and frames.
[[nodiscard]] Result<void> Validate(const Ros2Options& options);

}  // namespace cairn::server
