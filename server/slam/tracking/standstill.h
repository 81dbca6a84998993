// A robot that stands. Every match has the noise of its scan, so the pose of a robot that stands would follow the
// noise: with a cheap lidar by centimetres. While odometry says that the robot stands, and the matches do not
// contradict, it is told to be at the mean of the matches since it stopped. The noise of a match is the one that its
// points show. Before the first motion it is at the start, which has no error.
// Odometry can be wrong: wheels freeze or slip, somebody carries the robot. So the robot counts as moved, and is told
// to be where the last match is, as soon as the last few matches together differ from the mean by more than their
// noise, or one does and is far away. A single match that is a few centimetres off is not enough: it may be wrong. The
// track itself is that of the matches: this changes only where the robot is told to be. Frame: poses in `track`. Not
// thread-safe. Source: the recursive mean; the moving average of the innovations is the chart of Roberts, Technometrics
// 1959.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "common/geometry/pose2.h"
#include "server/slam/matching/match_result.h"

namespace cairn::slam {

class Standstill {
 public:
  // The next scan defines `track`.
  void Restart() { *this = {}; }
  // The first scan, at this pose.
  void Begin(const Pose2& T_track_robot, const Pose2& T_odom_robot);
  // Takes the match of the next scan. Returns where the robot stands; nothing if it does not.
  std::optional<Pose2> Take(const Pose2& T_odom_robot, const MatchResult& match);
  void MoveTo(const Pose2& T_new_old);

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.matches_, self.at_start_, self.T_odom_begin_, self.begin_, self.mean_, self.recent_, self.noise_);
    archive.Require(self.matches_ >= 0.0 && self.matches_ <= 1e6 && self.noise_ >= 1.0 && self.noise_ <= 1e6,
                    "a robot that stands");
  }

 private:
  enum class Verdict : std::uint8_t {
    kStands = 0,
    kDoubtful,  // This match alone says that the robot has moved a little.
    kMoved,
  };
  [[nodiscard]] Verdict Judge(const Eigen::Vector3d& innovation, const Eigen::Matrix3d& noise);

  double matches_ = 0.0;  // Since the robot stands; 0 if that is not known.
  bool at_start_ = false;
  Pose2 T_odom_begin_;                                // Odometry when it stopped.
  Pose2 begin_;                                       // The pose at the start.
  Pose2 mean_;                                        // Of the matches.
  Eigen::Vector3d recent_ = Eigen::Vector3d::Zero();  // Moving average of the innovations.
  double noise_ = 1.0;                                // Variance of the innovations as a share of the told one.
};

}  // namespace cairn::slam
