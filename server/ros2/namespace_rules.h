// Which robot of which site a namespace of ROS 2 belongs to, by the rules in `ros2.namespaces`. A rule is a path whose
// parts are names, {robot} or {site}; or a path, '=', and the robot or site/robot that it stands for. Plain value.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/status.h"

namespace cairn::server {

struct RobotPlace {
  std::string robot;
  std::string site;

  bool operator==(const RobotPlace&) const = default;
};

class NamespaceRules {
 public:
  // `site`: of rules that name none.
  [[nodiscard]] static Result<NamespaceRules> Parse(const std::string& rules, const std::string& site);
  // `name_space` as "/", "/r1", "/hall/r1". Nothing where no rule fits, or what it would name is no name of Cairn's.
  [[nodiscard]] std::optional<RobotPlace> PlaceOf(std::string_view name_space) const;

 private:
  struct Rule {
    std::vector<std::string> parts;
    std::string robot;  // Where the rule has '='.
    std::string site;
  };
  std::vector<Rule> rules_;
};

// The namespace of a topic as it is on the wire: "rt/r1/front/scan" is `stream` front/scan of /r1. Nothing for another
// stream.
[[nodiscard]] std::optional<std::string> NamespaceOf(std::string_view topic, std::string_view stream);
// The name on the wire of a topic in a namespace.
[[nodiscard]] std::string TopicIn(std::string_view name_space, std::string_view stream);
// A name of Cairn's as a part of a topic, which has letters, digits and _ only and begins with no digit.
[[nodiscard]] std::string TopicPart(std::string_view name);

}  // namespace cairn::server
