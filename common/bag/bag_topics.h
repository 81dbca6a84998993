// Which topics of a bag are the drive of a robot. Stateless, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/bag/bag_file.h"
#include "common/status.h"

namespace cairn::bag {

struct TopicChoice {
  Topic scans;
  std::optional<Topic> odometry;   // Nothing: odometry is a transform of `moving`.
  std::vector<Topic> fixed = {};   // Transforms: those of every tf_static,
  std::vector<Topic> moving = {};  // and of every tf.
};

// The only topic of its type, or the one that is named (a slash in front may be left out; as odometry also one of
// transforms). Fails where that is none or several, and lists the topics that there are.
[[nodiscard]] Result<TopicChoice> ChooseTopics(const std::vector<Topic>& topics, const std::string& scan_topic,
                                               const std::string& odometry_topic);

}  // namespace cairn::bag
