// The first pass over a bag, before anything is emitted: which topics are read, the frames of lidar and robot, and how
// the one is mounted on the other. Not thread-safe.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/bag/bag_file.h"
#include "common/bag/bag_topics.h"
#include "common/ros2/frame_tree.h"
#include "common/ros2/scan_conversion.h"
#include "common/sensor/log_reader.h"

namespace cairn::bag {

using Files = std::vector<std::unique_ptr<File>>;

// The messages of some topics, file after file; a message that was compressed by itself is unpacked.
// `sink(index in topics, bytes)` returns false when no more is wanted.
[[nodiscard]] Result<void> ReadMessages(const Files& files, const std::vector<Topic>& topics, const File::Sink& sink);

class BagSurvey {
 public:
  // Fails where it is not clear which topics are meant or, unless the options say it, where the lidar is mounted.
  [[nodiscard]] static Result<BagSurvey> Of(const Files& files, const LogReaderOptions& options);

  [[nodiscard]] const TopicChoice& topics() const { return topics_; }
  [[nodiscard]] const std::string& odometry_frame() const { return odometry_frame_; }
  [[nodiscard]] const std::string& base_frame() const { return base_frame_; }
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }
  [[nodiscard]] std::vector<std::string> LidarNames() const;  // The topics of their scans.
  // How a lidar is mounted on the robot whose scans are in the plane T_frame_scan of this frame. What the options say
  // counts first, but only transforms say whether it is tilted or upside down.
  [[nodiscard]] Result<ros2::Mounting> MountingOf(const std::string& laser_frame, const ros2::Pose3& T_frame_scan,
                                                  const std::optional<Pose2>& T_robot_laser) const;

 private:
  struct FirstScan {
    std::optional<std::string> frame;  // Nothing where there is no scan.
    ros2::Pose3 T_frame_scan;
  };

  // That the scans of several topics are those of several lidars, whose mountings are known.
  [[nodiscard]] Result<void> CheckLidars(const LogReaderOptions& options) const;
  Result<void> ReadFirstFrames(const Files& files);
  Result<void> ReadFixed(const Files& files);
  // Where odometry does not name the robot's frame, a transform from the odometry's frame does.
  Result<void> FindBaseFrame(const Files& files);
  // Reads all of them, or until `enough`, which is asked when something has changed.
  Result<void> ReadMoving(const Files& files, const std::function<bool()>& enough);
  // Which of the moving transforms is the odometry.
  Result<void> FindOdometryTransform();

  TopicChoice topics_;
  std::vector<FirstScan> first_scans_;  // Of each lidar.
  std::string odometry_frame_;
  std::string base_frame_;
  ros2::FrameTree fixed_;
  ros2::FrameTree moving_;
  std::set<std::pair<std::string, std::string>> odometry_links_;  // Parent, called odom, and child.
  std::vector<std::string> notes_;
};

}  // namespace cairn::bag
