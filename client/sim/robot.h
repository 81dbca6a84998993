// One simulated robot: drives its route, and keeps its true pose and the pose that its odometry computes.
// Frames: truth in `map`, odometry in `odom`.
#pragma once

#include <vector>

#include "client/sim/laser.h"
#include "client/sim/random.h"
#include "client/sim/route_follower.h"
#include "client/sim/wheels.h"

namespace cairn::sim {

class Robot {
 public:
  Robot(const Pose2& T_map_robot_start, RouteFollower follower, const WheelOptions& wheels, Random random);

  // Moves to `seconds` after the start, which is not before the time reached so far.
  void DriveUntil(double seconds) { Drive(seconds, nullptr); }
  // The same; adds to `legs` what it drives, in seconds after the start.
  void DriveUntil(double seconds, std::vector<DriveLeg>& legs) { Drive(seconds, &legs); }

  // Lets the robot brake and stand from now on, or drive its route again.
  void Halt(bool halt) { halt_ = halt; }

  // The true pose at a time a little after the one reached, if the robot kept its velocities.
  [[nodiscard]] Pose2 PoseAt(double seconds) const;

  [[nodiscard]] const Pose2& T_map_robot() const { return T_map_robot_; }
  [[nodiscard]] const Pose2& T_odom_robot() const { return wheels_.T_odom_robot(); }
  [[nodiscard]] double seconds() const { return seconds_; }  // The time reached.
  [[nodiscard]] const Twist& twist() const { return twist_; }
  [[nodiscard]] Random& random() { return random_; }

 private:
  void Drive(double seconds, std::vector<DriveLeg>* legs);

  RouteFollower follower_;
  WheelOdometry wheels_;
  Random random_;
  Pose2 T_map_robot_;
  Twist twist_;
  double seconds_ = 0.0;
  bool halt_ = false;
};

}  // namespace cairn::sim
