// What one ROS 2 robot publishes, as the samples that a robot of Cairn's would send. The server does the same at its
// door (server/ros2/robot_stream.h); this is for a recorder, which writes down what can be used and no more. Not
// thread-safe: one owner.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/ros2/frame_tree.h"
#include "common/ros2/scan_conversion.h"
#include "common/service/names.h"
#include "common/service/stream.h"
#include "common/wire/ros2/bus.h"
#include "common/wire/ros2/sample_numbers.h"

namespace cairn::client {

class Ros2Samples {
 public:
  // `shared`: the transforms of the topics that all robots share. It outlives the object.
  Ros2Samples(std::string robot, const ros2::FrameTree& shared) : robot_(std::move(robot)), shared_(shared) {}

  // Nothing where the robot's odometry or the mounting of the lidar is not known yet. `sensor`: as the server names it.
  [[nodiscard]] std::optional<ScanSample> Take(const std::string& sensor, ros2::LaserScan&& message,
                                               const ros2::Origin& origin);
  // Nothing where it is no pose.
  [[nodiscard]] std::optional<OdometrySample> Take(const ros2::Odometry& message, const ros2::Origin& origin);
  // Of the robot's own topics: kept, and returned where they are odometry.
  [[nodiscard]] std::vector<OdometrySample> Take(const ros2::Transforms& message, const ros2::Origin& origin);
  // Of the shared topics: returned where they are odometry of this robot. `only`: also under names without the robot's.
  [[nodiscard]] std::vector<OdometrySample> TakeShared(const ros2::Transforms& message, bool only,
                                                       const ros2::Origin& origin);
  // A robot with a topic of odometry is believed by that, and not by its transforms.
  void SetOdometryTopic(bool has) { has_odometry_topic_ = has; }

 private:
  struct Lidar {
    ros2::SampleNumbers numbers;
    std::string frame;
    std::uint64_t version = 0;  // Of the frames when the mounting was looked for.
    std::optional<ros2::Mounting> mounting;
  };

  void FindMounting(Lidar& lidar) const;
  std::vector<OdometrySample> FromTransforms(const ros2::Transforms& message, bool only, const ros2::Origin& origin);

  const std::string robot_;
  const NameId robot_id_ = HashName(robot_);
  const ros2::FrameTree& shared_;
  ros2::FrameTree own_;
  std::map<std::string, Lidar> lidars_;  // By sensor.
  std::string odom_frame_;
  std::string base_frame_;  // Empty until odometry says it.
  ros2::SampleNumbers odometry_numbers_;
  bool has_odometry_topic_ = false;
};

}  // namespace cairn::client
