// What the server's report about ROS 2 robots says in words: why a robot is not on the map, and what else is wrong.
// `cairn ros2 doctor` prints these texts, and the page of cairn-web shows them. Names in them come from the wire:
// whoever shows them escapes them. Stateless.
#pragma once

#include <string>
#include <vector>

#include "common/service/ros2_report.h"

namespace cairn::client {

struct Ros2Findings {
  struct Namespace {
    std::string name;                   // "/r1".
    std::string who;                    // The robot and the site that the rules of the server give it.
    bool on_map = false;                // Scans are used, and its last pose is localized.
    std::vector<std::string> problems;  // Why not, or what else is wrong, in the order in which to mend them.
    std::vector<std::string> topics;    // One line each: what arrives.
  };
  std::string where;                  // Where the server looks, and what it has lost there.
  std::vector<std::string> problems;  // Of all robots together.
  std::string advice;                 // Where no namespace is seen: what to look at. Else empty.
  std::vector<Namespace> namespaces;
};

[[nodiscard]] Ros2Findings FindingsOf(const Ros2Report& report);
// Several lines, each with its line end.
[[nodiscard]] std::string FormatRos2(const Ros2Findings& findings);

}  // namespace cairn::client
