#include "server/ros2/ros2_options.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "common/options/number_text.h"
#include "common/service/names.h"
#include "common/wire/bus.h"
#include "server/ros2/namespace_rules.h"

namespace cairn::server {
namespace {

std::vector<std::string> Names(const std::string& text) {
  std::vector<std::string> names;
  for (const std::string& part : SplitAtCommas(text)) {
    std::string name = part;
    std::erase(name, ' ');
    if (!name.empty()) names.push_back(std::move(name));
  }
  return names;
}

// Names of topics and frames relative to a namespace: "scan", "front/scan".
Result<void> CheckNames(const std::string& key, const std::vector<std::string>& names) {
  if (names.empty()) return Fail(StatusCode::kInvalidArgument, key + ": name at least one");
  for (const std::string& name : names) {
    const bool printable = std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c <= '~'; });
    if (!printable || name.front() == '/' || name.back() == '/')
      return Fail(StatusCode::kInvalidArgument, key + ": '" + name + "' is no name without a slash at its ends");
  }
  return {};
}

// They are written as those of the native wire, so that an error names the same key there.
Result<void> CheckDiscoveryServers(const std::vector<std::string>& servers) {
  constexpr std::string_view kNative = "wire.";
  wire::WireOptions wire;
  wire.discovery_servers = servers;
  const auto valid = wire::Validate(wire);
  if (valid) return {};
  return Fail(valid.error().code, "ros2." + valid.error().message.substr(kNative.size()));
}

}  // namespace

std::vector<std::string> Ros2Options::discovery_server_names() const {
  return Names(discovery_servers);
}

std::vector<std::string> Ros2Options::scan_names() const {
  return Names(scan_topics);
}

std::vector<std::string> Ros2Options::base_names() const {
  return Names(base_frames);
}

void Visit(OptionVisitor& visitor, Ros2Options& options) {
  visitor.Flag("enabled", options.enabled,
               ForOperators("Whether robots that run ROS 2 are served as they are (server/ros2/README.md)."));
  visitor.Integer("domain", options.domain, "", 0, 232,
                  ForOperators("The DDS domain of the ROS 2 robots (ROS_DOMAIN_ID)."));
  visitor.Text("interfaces", options.interfaces,
               ForOperators("IPv4 addresses of this machine on which the ROS 2 robots are met, separated by commas. "
                            "Empty: those of wire.interfaces."));
  visitor.Text("discovery_servers", options.discovery_servers,
               "For robots that find each other through discovery servers of Fast DDS: what is in their "
               "ROS_DISCOVERY_SERVER, with commas instead of semicolons. Empty: they are found by multicast.");
  visitor.Text("namespaces", options.namespaces,
               ForOperators("Rules, separated by commas, that say which robot a namespace of ROS 2 belongs to, such as "
                            "/{robot}, /{site}/{robot}, /fleet/{robot}, or /=r1 and /agv7=hall/r7 for one namespace. "
                            "The first rule that fits counts."));
  visitor.Text("site", options.site, ForOperators("The site of robots whose rule names none."));
  visitor.Text("scan_topics", options.scan_topics,
               ForOperators("Topics of laser scans in the namespace of a robot, separated by commas: one for each of "
                            "its lidars."));
  visitor.Text("odom_topic", options.odom_topic,
               ForOperators("Topic of odometry in the namespace of a robot. Without it, the transform from odom_frame "
                            "to one of base_frames is used."));
  visitor.Flag("commands", options.commands,
               ForOperators("Whether ROS 2 programs may save, load and reset sites and pause mapping through services. "
                            "Everybody in the DDS domain of the robots may then do so."));
  visitor.Text("odom_frame", options.odom_frame, "Frame of the odometry of a robot that sends it as a transform only.");
  visitor.Text("base_frames", options.base_frames,
               "Frames that may be the robot itself, separated by commas, for a robot whose odometry names none.");
  visitor.Text("map_frame", options.map_frame, "Frame of the map in all that is published.");
  visitor.Real(
      "transform_tolerance_s", options.transform_tolerance_s, "s", 0.0, 10.0,
      "The transform from map to odom is dated so far ahead of its scan, so that it can be used until the next "
      "one comes.");
  visitor.Real("map_period_s", options.map_period_s, "s", 0.5, 3600.0,
               "A map that has changed is published whole at least this often. In between, the changes are published "
               "as map_updates.");
  visitor.Integer("max_map_cells", options.max_map_cells, "cells", 16384, 1'000'000'000,
                  "Larger maps are not published to ROS 2, because a grid is one message.");
  visitor.Integer(
      "max_robots", options.max_robots, "", 1, 4096,
      "Namespaces that are looked at. Further ones are ignored until nobody publishes in one of these any more.");
}

Result<void> Validate(const Ros2Options& options) {
  if (!options.enabled) return {};
  if (auto valid = ValidateName("ros2.site", options.site); !valid) return valid;
  if (auto valid = CheckDiscoveryServers(options.discovery_server_names()); !valid) return valid;
  if (const auto rules = NamespaceRules::Parse(options.namespaces, options.site); !rules)
    return tl::unexpected(rules.error());
  if (auto valid = CheckNames("ros2.scan_topics", options.scan_names()); !valid) return valid;
  if (auto valid = CheckNames("ros2.odom_topic", {options.odom_topic}); !valid) return valid;
  if (auto valid = CheckNames("ros2.odom_frame", {options.odom_frame}); !valid) return valid;
  if (auto valid = CheckNames("ros2.map_frame", {options.map_frame}); !valid) return valid;
  constexpr std::size_t kMostSensors = 15;
  if (options.scan_names().size() > kMostSensors)
    return Fail(StatusCode::kInvalidArgument, "ros2.scan_topics: at most 15 lidars");
  return CheckNames("ros2.base_frames", options.base_names());
}

}  // namespace cairn::server
