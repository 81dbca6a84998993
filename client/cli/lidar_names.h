// Under which names a robot's lidars are sent to the server, from the topics of their scans in a bag. Pure function.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/service/names.h"

namespace cairn::client {

// As the server names the lidars of robots that run ROS 2: "/front/scan" is front.scan. Of a recording, the name that
// the robot used: "/robots/r1/scan/rear" is rear. Different topics get different names.
[[nodiscard]] inline std::vector<std::string> LidarNames(const std::vector<std::string>& topics) {
  constexpr std::size_t kLongest = 56;  // ValidateName allows 64.
  constexpr std::string_view kRecorded = "/robots/", kScan = "/scan/";
  std::vector<std::string> names;
  for (const std::string& topic : topics) {
    const std::size_t scan = topic.rfind(kScan);
    const bool recorded = topic.rfind(kRecorded, 0) == 0 && scan != std::string::npos;
    std::string name = topic.substr(recorded ? scan + kScan.size() : 0);
    if (!name.empty() && name.front() == '/') name.erase(0, 1);
    std::replace(name.begin(), name.end(), '/', '.');
    name = name.substr(0, kLongest);
    if (!ValidateName("a sensor", name)) name = "laser";
    if (std::find(names.begin(), names.end(), name) != names.end()) name += "-" + std::to_string(names.size() + 1);
    names.push_back(std::move(name));
  }
  return names;
}

}  // namespace cairn::client
