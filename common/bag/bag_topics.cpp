#include "common/bag/bag_topics.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <span>
#include <string_view>
#include <utility>

#include "common/bag/foxglove_encoding.h"

namespace cairn::bag {
namespace {

// The types of messages that mean the same, with their encodings.
struct MessageType {
  std::string_view name, encoding;
};
using MessageTypes = std::span<const MessageType>;
constexpr std::array kScanTypes = {MessageType{"sensor_msgs/msg/LaserScan", "cdr"},
                                   MessageType{kLaserScanSchema, kProtobuf}};
constexpr std::array kOdometryTypes = {MessageType{"nav_msgs/msg/Odometry", "cdr"},
                                       MessageType{kPoseSchema, kProtobuf}};
constexpr std::array kTransformTypes = {MessageType{"tf2_msgs/msg/TFMessage", "cdr"},
                                        MessageType{kTransformSchema, kProtobuf},
                                        MessageType{kTransformsSchema, kProtobuf}};
constexpr std::array kDetailsTypes = {MessageType{kScanDetailsSchema, kProtobuf},
                                      MessageType{kOdometryDetailsSchema, kProtobuf}};

std::string ListOf(const std::vector<Topic>& topics) {
  constexpr std::size_t kMostListed = 40;
  if (topics.empty()) return "it has no topics";
  std::string text = "its topics are";
  for (std::size_t i = 0; i < std::min(topics.size(), kMostListed); ++i) {
    text += (i == 0 ? " " : ", ") + topics[i].name + " (" + topics[i].type;
    const bool usual = topics[i].encoding == "cdr" || topics[i].encoding == kProtobuf;
    text += usual ? ")" : " as " + topics[i].encoding + ")";
  }
  return topics.size() > kMostListed ? text + ", and others" : text;
}

std::vector<Topic> OfTypes(const std::vector<Topic>& topics, MessageTypes types) {
  std::vector<Topic> found;
  std::copy_if(topics.begin(), topics.end(), std::back_inserter(found), [&](const Topic& topic) {
    return std::any_of(types.begin(), types.end(), [&](const MessageType& type) {
      return topic.type == type.name && topic.encoding == type.encoding;
    });
  });
  return found;
}

std::string_view WithoutSlash(std::string_view name) {
  return name.starts_with('/') ? name.substr(1) : name;
}

bool IsCalledOdometry(std::string_view topic) {
  return topic.ends_with("odometry") || topic.ends_with("odom");
}

// Topics that are odometry, although nobody says so.
std::vector<Topic> OdometryAmong(const std::vector<Topic>& topics, const std::string& scan_topic) {
  std::vector<Topic> found = OfTypes(topics, kOdometryTypes);
  std::erase_if(found, [](const Topic& topic) { return topic.type == kPoseSchema && !IsCalledOdometry(topic.name); });
  const std::size_t scan = scan_topic.rfind("/scan/");  // A lidar may be called scan, too.
  if (found.size() < 2 || scan == std::string::npos) return found;
  const auto beside = std::find_if(found.begin(), found.end(), [&](const Topic& topic) {
    return topic.type == kPoseSchema && topic.name == scan_topic.substr(0, scan) + "/odometry";
  });
  return beside == found.end() ? found : std::vector<Topic>{*beside};
}

// The topic of `found` that is meant. `option`: that of the command line which names it.
Result<Topic> Choose(const std::vector<Topic>& all, std::vector<Topic> found, MessageTypes types,
                     const std::string& wanted, const std::string& option) {
  if (!wanted.empty())
    std::erase_if(found, [&](const Topic& topic) { return WithoutSlash(topic.name) != WithoutSlash(wanted); });
  std::string kind = "topic " + (wanted.empty() ? std::string() : "'" + wanted + "' ") + "of type ";
  for (const MessageType& type : types) kind += (&type == types.data() ? "" : " or ") + std::string(type.name);
  if (found.empty()) return Fail(StatusCode::kNotFound, "no " + kind + "; " + ListOf(all));
  if (found.size() > 1)
    return Fail(StatusCode::kInvalidArgument, "more than one " + kind + ", " + option + " chooses; " + ListOf(found));
  return found.front();
}

// "/robots/r1" of "/robots/r1/scan/front", where `cairn record` has put the scans of a robot. Empty for other topics.
std::string_view RobotOf(const Topic& topic) {
  const std::size_t scan = topic.encoding == kProtobuf ? topic.name.rfind("/scan/") : std::string::npos;
  return scan == std::string::npos ? std::string_view() : std::string_view(topic.name).substr(0, scan);
}

Result<std::vector<Topic>> ChooseScans(const std::vector<Topic>& topics, const std::string& scan_topic,
                                       bool all_lidars) {
  constexpr std::size_t kMostLidars = 16;  // That a session has.
  const std::string option = "--scan-topic";
  std::vector<Topic> found = OfTypes(topics, kScanTypes), chosen;
  if (all_lidars && scan_topic.empty() && found.size() > 1 && found.size() <= kMostLidars) {
    const bool of_one_robot = std::all_of(found.begin(), found.end(),
                                          [&](const Topic& topic) { return RobotOf(topic) == RobotOf(found.front()); });
    if (of_one_robot) return found;
  }
  std::string_view names = scan_topic;
  do {
    const std::string name(names.substr(0, all_lidars ? names.find(',') : names.size()));
    auto one = Choose(topics, found, kScanTypes, name, option);
    if (!one) return tl::unexpected(one.error());
    if (std::find(chosen.begin(), chosen.end(), *one) != chosen.end() || chosen.size() == kMostLidars)
      return Fail(StatusCode::kInvalidArgument, option + " names a topic twice, or more than 16");
    chosen.push_back(*std::move(one));
    names.remove_prefix(std::min(names.size(), name.size() + 1));
  } while (!names.empty());
  return chosen;
}

std::optional<Topic> DetailsOf(const std::vector<Topic>& topics, const Topic& topic) {
  const std::vector<Topic> details = OfTypes(topics, kDetailsTypes);
  const std::string_view type = topic.type == kLaserScanSchema ? kScanDetailsSchema : kOdometryDetailsSchema;
  const auto found = std::find_if(details.begin(), details.end(), [&](const Topic& one) {
    return one.type == type && one.name == topic.name + kDetailsSuffix;
  });
  return found == details.end() ? std::nullopt : std::optional(*found);
}

}  // namespace

Result<TopicChoice> ChooseTopics(const std::vector<Topic>& topics, const std::string& scan_topic,
                                 const std::string& odometry_topic, bool all_lidars) {
  auto scans = ChooseScans(topics, scan_topic, all_lidars);
  if (!scans) return tl::unexpected(scans.error());
  TopicChoice choice;
  for (Topic& one : *scans) {
    std::optional<Topic> details = DetailsOf(topics, one);
    choice.lidars.push_back({std::move(one), std::move(details)});
  }
  for (Topic& topic : OfTypes(topics, kTransformTypes))
    (topic.name.ends_with("tf_static") ? choice.fixed : choice.moving).push_back(std::move(topic));
  const bool named_transforms = std::any_of(choice.moving.begin(), choice.moving.end(), [&](const Topic& topic) {
    return WithoutSlash(topic.name) == WithoutSlash(odometry_topic);
  });
  std::vector<Topic> odometries = odometry_topic.empty() ? OdometryAmong(topics, choice.lidars.front().scans.name)
                                                         : OfTypes(topics, kOdometryTypes);
  const bool only_transforms = odometry_topic.empty() && odometries.empty() && !choice.moving.empty();
  if (named_transforms || only_transforms) return choice;
  auto odometry = Choose(topics, std::move(odometries), kOdometryTypes, odometry_topic, "--odom-topic");
  if (!odometry) return tl::unexpected(odometry.error());
  choice.odometry_details = DetailsOf(topics, *odometry);
  choice.odometry = *std::move(odometry);
  return choice;
}

}  // namespace cairn::bag
