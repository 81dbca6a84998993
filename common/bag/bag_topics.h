// Which topics of a bag are the drive of a robot. Stateless, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/bag/bag_file.h"
#include "common/status.h"

namespace cairn::bag {

// The scans of one lidar.
struct ScanTopic {
  Topic scans;
  std::optional<Topic> details = {};  // Of a recording of Cairn's own (idl/cairn/recording.proto).
};

struct TopicChoice {
  std::vector<ScanTopic> lidars;               // At least one.
  std::optional<Topic> odometry = {};          // Nothing: odometry is a transform of `moving`.
  std::optional<Topic> odometry_details = {};  // As of ScanTopic.
  std::vector<Topic> fixed = {};               // Transforms: those of every tf_static,
  std::vector<Topic> moving = {};              // and of every tf.
};

// The only topic of its types, or the one that is named (a slash in front may be left out; as odometry also one of
// transforms). Types are those of ROS 2 and those of Foxglove. A foxglove.PoseInFrame that nobody has named counts as
// odometry where its topic is called so; of several, the one beside the scans: ROBOT/odometry with ROBOT/scan/LASER.
// Fails where that is none or several, and lists the topics that there are.
// With `all_lidars`, several topics of scans are the lidars of one robot: those that are named, with commas between
// them, or all, unless a recording has those of several robots.
[[nodiscard]] Result<TopicChoice> ChooseTopics(const std::vector<Topic>& topics, const std::string& scan_topic,
                                               const std::string& odometry_topic, bool all_lidars = false);

}  // namespace cairn::bag
