#include "server/ros2/namespace_rules.h"

#include <algorithm>
#include <utility>

#include "common/options/number_text.h"
#include "common/service/names.h"

namespace cairn::server {
namespace {

constexpr std::string_view kRobot = "{robot}";
constexpr std::string_view kSite = "{site}";

std::vector<std::string> PartsOf(std::string_view path) {
  std::vector<std::string> parts;
  while (!path.empty()) {
    const std::size_t end = std::min(path.find('/'), path.size());
    if (end > 0) parts.emplace_back(path.substr(0, end));
    path.remove_prefix(std::min(end + 1, path.size()));
  }
  return parts;
}

bool IsTopicCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

tl::unexpected<Status> Bad(const std::string& rule, const std::string& why) {
  return Fail(StatusCode::kInvalidArgument, "ros2.namespaces: '" + rule + "' " + why);
}

}  // namespace

Result<NamespaceRules> NamespaceRules::Parse(const std::string& rules, const std::string& site) {
  NamespaceRules parsed;
  for (std::string text : SplitAtCommas(rules)) {
    std::erase(text, ' ');
    if (text.empty()) continue;
    if (text.front() != '/') return Bad(text, "does not begin with a slash");
    const std::size_t equals = text.find('=');
    Rule rule{PartsOf(std::string_view(text).substr(0, equals)), {}, site};
    const auto robots = std::count(rule.parts.begin(), rule.parts.end(), kRobot);
    const auto sites = std::count(rule.parts.begin(), rule.parts.end(), kSite);
    if (equals != std::string::npos) {
      std::vector<std::string> place = PartsOf(std::string_view(text).substr(equals + 1));
      if (robots + sites > 0) return Bad(text, "has both '=' and a name in braces");
      if (place.empty() || place.size() > 2) return Bad(text, "needs a robot, or a site/robot, behind '='");
      rule.robot = place.back();
      if (place.size() == 2) rule.site = place.front();
    } else if (robots != 1 || sites > 1) {
      return Bad(text, "needs {robot} once and {site} at most once");
    }
    for (const std::string& name : {rule.robot.empty() ? std::string("r") : rule.robot, rule.site})
      if (auto valid = ValidateName("ros2.namespaces", name); !valid) return tl::unexpected(valid.error());
    for (const std::string& part : rule.parts) {
      const bool braces = part == kRobot || part == kSite;
      if (!braces && !std::all_of(part.begin(), part.end(), IsTopicCharacter))
        return Bad(text, "has a part that is no name of ROS");
    }
    parsed.rules_.push_back(std::move(rule));
  }
  if (parsed.rules_.empty()) return Bad(rules, "has no rule");
  return parsed;
}

std::optional<RobotPlace> NamespaceRules::PlaceOf(std::string_view name_space) const {
  const std::vector<std::string> parts = PartsOf(name_space);
  for (const Rule& rule : rules_) {
    if (rule.parts.size() != parts.size()) continue;
    RobotPlace place{rule.robot, rule.site};
    bool fits = true;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (rule.parts[i] == kRobot) {
        place.robot = parts[i];
      } else if (rule.parts[i] == kSite) {
        place.site = parts[i];
      } else {
        fits = fits && rule.parts[i] == parts[i];
      }
    }
    if (fits && ValidateName("robot", place.robot) && ValidateName("site", place.site)) return place;
  }
  return std::nullopt;
}

std::optional<std::string> NamespaceOf(std::string_view topic, std::string_view stream) {
  constexpr std::string_view kPrefix = "rt/";
  if (!topic.starts_with(kPrefix)) return std::nullopt;
  topic.remove_prefix(kPrefix.size() - 1);  // The slash stays: it begins the name that ROS shows.
  if (!topic.ends_with(stream)) return std::nullopt;
  topic.remove_suffix(stream.size());
  if (topic.empty() || topic.back() != '/') return std::nullopt;
  if (topic.size() > 1) topic.remove_suffix(1);
  return std::string(topic);
}

std::string TopicIn(std::string_view name_space, std::string_view stream) {
  std::string topic = "rt" + std::string(name_space);
  if (topic.back() != '/') topic += '/';
  return topic + std::string(stream);
}

std::string TopicPart(std::string_view name) {
  std::string part(name);
  std::replace_if(
      part.begin(), part.end(), [](char c) { return !IsTopicCharacter(c); }, '_');
  if (!part.empty() && part.front() >= '0' && part.front() <= '9') part.insert(0, "site_");
  return part;
}

}  // namespace cairn::server
