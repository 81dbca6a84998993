#include "common/bag/bag_topics.h"

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

namespace cairn::bag {
namespace {

constexpr std::string_view kScanType = "sensor_msgs/msg/LaserScan";
constexpr std::string_view kOdometryType = "nav_msgs/msg/Odometry";
constexpr std::string_view kTransformType = "tf2_msgs/msg/TFMessage";

std::string ListOf(const std::vector<Topic>& topics) {
  constexpr std::size_t kMostListed = 40;
  if (topics.empty()) return "it has no topics";
  std::string text = "its topics are";
  for (std::size_t i = 0; i < std::min(topics.size(), kMostListed); ++i) {
    text += (i == 0 ? " " : ", ") + topics[i].name + " (" + topics[i].type;
    text += topics[i].encoding == "cdr" ? ")" : " as " + topics[i].encoding + ")";
  }
  return topics.size() > kMostListed ? text + ", and others" : text;
}

std::vector<Topic> OfType(const std::vector<Topic>& topics, std::string_view type) {
  std::vector<Topic> found;
  std::copy_if(topics.begin(), topics.end(), std::back_inserter(found),
               [&](const Topic& topic) { return topic.type == type && topic.encoding == "cdr"; });
  return found;
}

std::string_view WithoutSlash(std::string_view name) {
  return name.starts_with('/') ? name.substr(1) : name;
}

// `option`: that of the command line which names the topic.
Result<Topic> Choose(const std::vector<Topic>& topics, std::string_view type, const std::string& wanted,
                     const std::string& option) {
  std::vector<Topic> found = OfType(topics, type);
  if (!wanted.empty())
    std::erase_if(found, [&](const Topic& topic) { return WithoutSlash(topic.name) != WithoutSlash(wanted); });
  const std::string kind =
      "topic " + (wanted.empty() ? std::string() : "'" + wanted + "' ") + "of type " + std::string(type);
  if (found.empty()) return Fail(StatusCode::kNotFound, "no " + kind + "; " + ListOf(topics));
  if (found.size() > 1)
    return Fail(StatusCode::kInvalidArgument, "more than one " + kind + ", " + option + " chooses; " + ListOf(found));
  return found.front();
}

}  // namespace

Result<TopicChoice> ChooseTopics(const std::vector<Topic>& topics, const std::string& scan_topic,
                                 const std::string& odometry_topic) {
  auto scans = Choose(topics, kScanType, scan_topic, "--scan-topic");
  if (!scans) return tl::unexpected(scans.error());
  TopicChoice choice{.scans = *std::move(scans), .odometry = std::nullopt};
  for (Topic& topic : OfType(topics, kTransformType))
    (topic.name.ends_with("tf_static") ? choice.fixed : choice.moving).push_back(std::move(topic));
  const bool named_transforms = std::any_of(choice.moving.begin(), choice.moving.end(), [&](const Topic& topic) {
    return WithoutSlash(topic.name) == WithoutSlash(odometry_topic);
  });
  const bool only_transforms =
      odometry_topic.empty() && OfType(topics, kOdometryType).empty() && !choice.moving.empty();
  if (named_transforms || only_transforms) return choice;
  auto odometry = Choose(topics, kOdometryType, odometry_topic, "--odom-topic");
  if (!odometry) return tl::unexpected(odometry.error());
  choice.odometry = *std::move(odometry);
  return choice;
}

}  // namespace cairn::bag
